/* The loops behind the kernels, compiled for several processors; which one runs is decided when
   the module is loaded.

   Plain C with the vector extensions of GCC and Clang: the same source for x86-64 and aarch64.
   Vectors are as wide as the processor's registers: GCC 12 makes of wider ones, where it must
   take them apart, code that is ten times slower. */
#ifndef UAVRT_LOOPS_H
#define UAVRT_LOOPS_H
#include "common.h"

#define MOST_LANES 16
/* Of any version: what it reads past the end of padded rows is bounded by this. */
#define MOST_WINDOW 128
/* Half the longest window of cell_powers, in samples of the narrow band. */
typedef float four_t __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t choice_four_t __attribute__((vector_size(16)));

#define INLINE static inline __attribute__((always_inline))
#define LOAD4(at) (*(const four_t *)(at))
#define STORE4(at, value) (*(four_t *)(at) = (value))
#if defined(__clang__)
#define SHUFFLE4(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#define SHUFFLE4(a, b, i, j, k, l) __builtin_shuffle(a, b, (choice_four_t){i, j, k, l})
#endif

typedef struct {
    Py_ssize_t column, row;
    float power;
} anchor_t;

typedef struct {
    float best;     /* the largest sum, over the noise of the row */
    float strength; /* of the sums within 0.01 of it, the largest without a limit */
    Py_ssize_t interval;
} sum_t;

/* What a drone sees of the ground; see terrain.h. */
typedef struct {
    const float *height, *tables;
    Py_ssize_t most;
    int32_t columns;
    float column, row;
    double tag, cell, wavelength, bulge;
} view_t;

/* Slots that are folded, and where their sums are made; see trains.h. */
typedef struct {
    const float *values;
    float *part[2];
    Py_ssize_t slots, period, stride;
} train_t;

#define CODE_BLOCK 64
/* Columns of bursts whose sums are made at once: as wide as the widest registers. */
#define CODE_PART 32
/* The same where several bursts are summed. */
#define CODE_PLACES 16
/* Intervals whose sums are picked at once. */

#define PLACES 4
/* Mixed at once. */
#define MOST_TILE 64
/* Cells mixed at once. */

/* Sums that are mixed for places, and what that works with. */
typedef struct {
    const float *sums, *scale, *mixing;
    Py_ssize_t patterns, rows, period, places;
    float *top, *tile, *mixed;
} mix_t;

/* The loops of one version; what they do stands where they are defined. */
typedef struct {
    void (*decimate_outputs)(const float *samples, const float *taps, Py_ssize_t length,
                             Py_ssize_t factor, Py_ssize_t count, float *out);
    float (*largest_part)(const float *values, Py_ssize_t count);
    void (*bank_outputs)(const float *samples, const float *weights, const float *twiddles,
                         const int32_t *chosen, Py_ssize_t channels, Py_ssize_t phases,
                         Py_ssize_t hop, Py_ssize_t rows, Py_ssize_t choices, int odd,
                         float *out, Py_ssize_t out_rows, float *work);
    void (*band_outputs)(const float *samples, Py_ssize_t floats, const float *taps,
                         Py_ssize_t length, Py_ssize_t factor, Py_ssize_t count,
                         const float *rows, const float *places, Py_ssize_t in_row, float *out);
    void (*cell_powers)(const float *samples, Py_ssize_t hop, Py_ssize_t length,
                        Py_ssize_t columns, const float *cosines, const float *sines,
                        Py_ssize_t middle, Py_ssize_t stride, float *power, float *work,
                        Py_ssize_t room);
    void (*window_powers)(const float *samples, Py_ssize_t hop, Py_ssize_t windows,
                          const float *taper, Py_ssize_t length, Py_ssize_t size,
                          const float *twiddles, Py_ssize_t first, Py_ssize_t bins, float *work,
                          float *out);
    Py_ssize_t (*find_anchors)(const float *cells, Py_ssize_t rows, Py_ssize_t width,
                               Py_ssize_t length, Py_ssize_t at, Py_ssize_t fresh,
                               Py_ssize_t reach, const float *levels, float share,
                               anchor_t **found);
    sum_t (*best_sum)(const float *line, Py_ssize_t length, Py_ssize_t column, float power,
                      float level, float limit, const Py_ssize_t *lows, const Py_ssize_t *rest,
                      Py_ssize_t others, Py_ssize_t intervals, Py_ssize_t stretch,
                      Py_ssize_t reach, float *work);
    void (*profile)(const view_t *view, float step_c, float step_r, Py_ssize_t points, float tag,
                    float bulge, float best[3]);
    void (*code_clip)(const uint8_t *cells, Py_ssize_t length, uint8_t clip, uint8_t *out);
    void (*code_sums)(const uint8_t *line, Py_ssize_t blocks, const int32_t *offsets,
                      Py_ssize_t stretches, Py_ssize_t pulses, uint8_t *best);
    uint8_t (*code_highest)(const uint8_t *sums);
    void (*code_add)(const uint8_t *line, Py_ssize_t blocks, const int32_t *own,
                     Py_ssize_t pulses, uint8_t clip, uint8_t *sums);
    void (*code_windows)(const uint8_t *work, Py_ssize_t room, const int32_t *starts,
                         const uint8_t *places, Py_ssize_t parts, Py_ssize_t bursts,
                         uint8_t *picked, int16_t *window, int32_t *out);
    void (*train_block)(const train_t *train, Py_ssize_t start, int level, Py_ssize_t low,
                        Py_ssize_t high);
    void (*train_highest)(const mix_t *mix, float *best, int32_t *cell);
} loops_t;

INLINE Py_ssize_t modulo(Py_ssize_t value, Py_ssize_t length)
{
    const Py_ssize_t rest = value % length;
    return rest < 0 ? rest + length : rest;
}

#define JOINED(name, version) name##_##version
#define JOIN(name, version) JOINED(name, version)
#define NAMED(name) JOIN(name, VERSION)

#define VERSION plain
#define LANES 4
#include "version.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 11
#define NEWER_PROCESSORS
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v3")
#define VERSION avx2
#define LANES 8
#include "version.h"
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("arch=x86-64-v4")
#define VERSION avx512
#define LANES 16
#include "version.h"
#pragma GCC pop_options
#endif

/* The version in use. */
static const loops_t *loops = &loops_plain;

/* Take the version for the processor at hand, or an older one's that was asked for; its name. */
static const char *choose_loops(const char *most)
{
#ifdef NEWER_PROCESSORS
    __builtin_cpu_init();
    const int avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                     __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    const int avx512 =
        avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl");
    if (avx512 && strcmp(most, "avx512") == 0) {
        loops = &loops_avx512;
        return "avx512";
    }
    if (avx2 && strcmp(most, "plain") != 0) {
        loops = &loops_avx2;
        return "avx2";
    }
#endif
    (void)most;
    loops = &loops_plain;
    return "plain";
}

#endif

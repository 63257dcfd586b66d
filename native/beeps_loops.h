/* Loops of beeps.h. Windows are transformed four at a time, in two arrays of the real and the
   imaginary parts: sample n of window f stands at 4 n + f. */

/* Samples of four windows that begin `hop` apart, times the taper, and zeros up to `size`. */
static void NAMED(taper_four)(const float *samples, const Py_ssize_t starts[4],
                              const float *taper, Py_ssize_t length, Py_ssize_t size, float *re,
                              float *im)
{
    const float *x[4];
    for (int f = 0; f < 4; f++)
        x[f] = samples + 2 * starts[f];
    Py_ssize_t n = 0;
    for (; n + 2 <= length; n += 2) {
        const four_t a = LOAD4(x[0] + 2 * n), b = LOAD4(x[1] + 2 * n);
        const four_t c = LOAD4(x[2] + 2 * n), d = LOAD4(x[3] + 2 * n);
        const four_t re_ab = SHUFFLE4(a, b, 0, 4, 2, 6), im_ab = SHUFFLE4(a, b, 1, 5, 3, 7);
        const four_t re_cd = SHUFFLE4(c, d, 0, 4, 2, 6), im_cd = SHUFFLE4(c, d, 1, 5, 3, 7);
        STORE4(re + 4 * n, SHUFFLE4(re_ab, re_cd, 0, 1, 4, 5) * taper[n]);
        STORE4(im + 4 * n, SHUFFLE4(im_ab, im_cd, 0, 1, 4, 5) * taper[n]);
        STORE4(re + 4 * n + 4, SHUFFLE4(re_ab, re_cd, 2, 3, 6, 7) * taper[n + 1]);
        STORE4(im + 4 * n + 4, SHUFFLE4(im_ab, im_cd, 2, 3, 6, 7) * taper[n + 1]);
    }
    for (; n < length; n++)
        for (int f = 0; f < 4; f++) {
            re[4 * n + f] = x[f][2 * n] * taper[n];
            im[4 * n + f] = x[f][2 * n + 1] * taper[n];
        }
    memset(re + 4 * length, 0, (size_t)(size - length) * 4 * sizeof(float));
    memset(im + 4 * length, 0, (size_t)(size - length) * 4 * sizeof(float));
}

/* One step of Stockham's transform: `parts` transforms of `radix` from x to y, each for `width`
   neighbours. twiddles[k] = exp(-2 pi i k / size), and `stride` steps of it are one step of p. */
#define PUT(i, r, s)                                                                            \
    do {                                                                                        \
        const vector_t first = (r), second = (s);                                               \
        *(vector_t *)(br + (i) * width + q) = first * wr[i] - second * wi[i];                   \
        *(vector_t *)(bi + (i) * width + q) = first * wi[i] + second * wr[i];                   \
    } while (0)
#define GET(i)                                                                                  \
    const vector_t r##i = *(const vector_t *)(ar + (i) * far + q),                              \
                   s##i = *(const vector_t *)(ai + (i) * far + q)
#define BUTTERFLIES butterflies
#define vector_t lanes_t
#define WIDTH LANES
#include "butterflies.h"
#undef BUTTERFLIES
#undef vector_t
#undef WIDTH
#define BUTTERFLIES narrow_butterflies
#define vector_t four_t
#define WIDTH 4
#include "butterflies.h"
#undef BUTTERFLIES
#undef vector_t
#undef WIDTH
#undef PUT
#undef GET

/* Transform the four windows in the first half of `work`; returns the half with the result. */
static float *NAMED(transform_four)(float *work, Py_ssize_t size, const float *twiddles)
{
    float *from = work, *to = work + 8 * size;
    Py_ssize_t stride = 1;
    for (Py_ssize_t left = size; left > 1;) {
        const int radix = left % 4 == 0 ? 4 : left % 2 == 0 ? 2 : left % 3 == 0 ? 3 : 5;
        left /= radix;
        if (4 * stride % LANES)
            NAMED(narrow_butterflies)(radix, from, to, size, left, twiddles, stride);
        else
            NAMED(butterflies)(radix, from, to, size, left, twiddles, stride);
        stride *= radix;
        float *other = from;
        from = to;
        to = other;
    }
    return from;
}

/* Power of `bins` frequencies from `first` on, round the end, into a row for each window. */
static void NAMED(window_powers)(const float *samples, Py_ssize_t hop, Py_ssize_t windows,
                                 const float *taper, Py_ssize_t length, Py_ssize_t size,
                                 const float *twiddles, Py_ssize_t first, Py_ssize_t bins,
                                 float *work, float *out)
{
    for (Py_ssize_t w = 0; w < windows; w += 4) {
        const int many = windows - w < 4 ? (int)(windows - w) : 4;
        Py_ssize_t starts[4];
        for (int f = 0; f < 4; f++)
            starts[f] = (w + (f < many ? f : many - 1)) * hop;
        NAMED(taper_four)(samples, starts, taper, length, size, work, work + 4 * size);
        const float *re = NAMED(transform_four)(work, size, twiddles), *im = re + 4 * size;
        float *row = out + w * bins;
        for (Py_ssize_t done = 0; done < bins;) {
            const Py_ssize_t at = (first + done) % size;
            const Py_ssize_t ends = size - at < bins - done ? size - at : bins - done;
            Py_ssize_t k = 0;
            for (; many == 4 && k + 4 <= ends; k += 4) {
                four_t power[4];
                for (int i = 0; i < 4; i++) {
                    const four_t r = LOAD4(re + 4 * (at + k + i));
                    const four_t s = LOAD4(im + 4 * (at + k + i));
                    power[i] = r * r + s * s;
                }
                const four_t ab = SHUFFLE4(power[0], power[1], 0, 4, 1, 5);
                const four_t cd = SHUFFLE4(power[2], power[3], 0, 4, 1, 5);
                const four_t ef = SHUFFLE4(power[0], power[1], 2, 6, 3, 7);
                const four_t gh = SHUFFLE4(power[2], power[3], 2, 6, 3, 7);
                STORE4(row + done + k, SHUFFLE4(ab, cd, 0, 1, 4, 5));
                STORE4(row + bins + done + k, SHUFFLE4(ab, cd, 2, 3, 6, 7));
                STORE4(row + 2 * bins + done + k, SHUFFLE4(ef, gh, 0, 1, 4, 5));
                STORE4(row + 3 * bins + done + k, SHUFFLE4(ef, gh, 2, 3, 6, 7));
            }
            for (; k < ends; k++)
                for (int f = 0; f < many; f++) {
                    const float r = re[4 * (at + k) + f], s = im[4 * (at + k) + f];
                    row[f * bins + done + k] = r * r + s * s;
                }
            done += ends;
        }
    }
}

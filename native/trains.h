/* Sums over all pulses of a flight, and the highest of them: uavrt.localization.whole_flight.energies.folding. */
#include "loops.h"

#define MOST_LEVELS 20

/* train_sums(values, many, slots, period, levels, first, count, out): of `many` rows of slots
   each, the sums over the slots p + k (period + d / (2^levels - 1)) of the intervals d from
   `first` on, as many as `count`: out is (many, count, period). */
static PyObject *train_sums(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[6];
    PyObject *result = NULL;
    float *work = NULL;
    if (!count_is(given, 8, "train_sums") || get_sizes(args + 1, size, 6) < 0)
        return NULL;
    const Py_ssize_t many = size[0], slots = size[1], period = size[2], first = size[4];
    const Py_ssize_t count = size[5], levels = size[3];
    if (levels < 0 || levels > MOST_LEVELS || period < 1 || period > INT32_MAX || slots < 0 ||
        first < 0 || count < 1 || first > ((Py_ssize_t)1 << levels) - count ||
        slots > ((Py_ssize_t)1 << levels) * period || !fits(many, slots) ||
        !fits(count, period) || !fits(many, count * period)) {
        PyErr_SetString(PyExc_ValueError, "train_sums: no such slots or intervals");
        return NULL;
    }
    const float *values = hold(&held, args[0], 0, 4, many * slots, NULL, "values");
    if (values == NULL)
        goto end;
    float *out = hold(&held, args[7], 1, 4, many * count * period, NULL, "out");
    if (out == NULL)
        goto end;
    /* Vectors reach beyond the ends of rows: each has room for one more. */
    const Py_ssize_t stride = period + MOST_LANES, room = ((Py_ssize_t)1 << levels) * stride;
    work = fits(room, 2) ? calloc(2 * room + MOST_LANES, sizeof(float)) : NULL;
    if (work == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t i = 0; i < many; i++) {
        const train_t train = {values + i * slots, {work, work + room}, slots, period, stride};
        loops->train_block(&train, 0, (int)levels, first, first + count - 1);
        const float *sums = train.part[levels & 1] + first * stride;
        for (Py_ssize_t row = 0; row < count; row++)
            memcpy(out + (i * count + row) * period, sums + row * stride,
                   sizeof(float) * period);
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    free(work);
    release(&held);
    return result;
}

/* train_peaks(sums, patterns, rows, period, scale, mixing, best, cell): of each place the
   highest of the sums (patterns, rows, period) mixed for it, each row times its scale, and
   where it stands among the rows and phases. */
static PyObject *train_peaks(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[3], places = 0;
    PyObject *result = NULL;
    float *work = NULL;
    if (!count_is(given, 8, "train_peaks") || get_sizes(args + 1, size, 3) < 0)
        return NULL;
    const Py_ssize_t patterns = size[0], rows = size[1], period = size[2];
    if (patterns < 1 || patterns > 1 << 16 || rows < 1 || period < 1 || !fits(rows, period) ||
        rows * period > INT32_MAX - MOST_TILE || !fits(patterns, rows * period)) {
        PyErr_SetString(PyExc_ValueError, "train_peaks: no such patterns or cells");
        return NULL;
    }
    const float *sums = hold(&held, args[0], 0, 4, patterns * rows * period, NULL, "sums");
    if (sums == NULL)
        goto end;
    const float *scale = hold(&held, args[4], 0, 4, rows, NULL, "scale");
    if (scale == NULL)
        goto end;
    float *best = hold(&held, args[6], 1, 4, 0, &places, "best");
    if (best == NULL)
        goto end;
    int32_t *cell = hold(&held, args[7], 1, 4, places, NULL, "cell");
    if (cell == NULL)
        goto end;
    if (!fits(places, patterns)) {
        PyErr_SetString(PyExc_ValueError, "train_peaks: too many places");
        goto end;
    }
    const float *mixing = hold(&held, args[5], 0, 4, places * patterns, NULL, "mixing");
    if (mixing == NULL)
        goto end;
    const Py_ssize_t groups = (places + PLACES - 1) / PLACES;
    const Py_ssize_t highest = 2 * groups * PLACES * MOST_LANES;
    const Py_ssize_t tile = patterns * MOST_TILE, mixed = groups * PLACES * patterns;
    work = malloc(sizeof(float) * (highest + tile + mixed));
    if (work == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    const mix_t mix = {sums, scale, mixing, patterns, rows, period, places,
                       work, work + highest, work + highest + tile};
    Py_BEGIN_ALLOW_THREADS
    loops->train_highest(&mix, best, cell);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    free(work);
    release(&held);
    return result;
}

/* Filters that keep every D-th sample. */
#include "common.h"

/* Sum of the even and of the odd lanes. */
INLINE void halves(lanes_t sum, float *even, float *odd)
{
    float part[LANES];
    memcpy(part, &sum, sizeof part);
    four_t low = LOAD4(part) + LOAD4(part + 8), high = LOAD4(part + 4) + LOAD4(part + 12);
    four_t both = low + high;
    *even = both[0] + both[2];
    *odd = both[1] + both[3];
}

/* out[n] = sum of taps[k] samples[factor n + k], with real taps that stand there twice,
   `length` floats of them; `spare` floats may be read past the last window. */
VERSIONS static void decimate_outputs(const float *samples, const float *taps,
                                      Py_ssize_t length, Py_ssize_t factor, Py_ssize_t count,
                                      float *out)
{
    const Py_ssize_t step = 2 * factor, whole = length / LANES * LANES;
    Py_ssize_t n = 0;
    for (; n + 4 <= count; n += 4) {
        const float *x = samples + n * step;
        lanes_t a = {0}, b = {0}, c = {0}, d = {0};
        for (Py_ssize_t k = 0; k < whole; k += LANES) {
            lanes_t tap = LOAD(taps + k);
            a += tap * LOAD(x + k);
            b += tap * LOAD(x + step + k);
            c += tap * LOAD(x + 2 * step + k);
            d += tap * LOAD(x + 3 * step + k);
        }
        float sums[8];
        halves(a, sums, sums + 1);
        halves(b, sums + 2, sums + 3);
        halves(c, sums + 4, sums + 5);
        halves(d, sums + 6, sums + 7);
        for (Py_ssize_t k = whole; k < length; k += 2) {
            for (int one = 0; one < 4; one++) {
                sums[2 * one] += taps[k] * x[one * step + k];
                sums[2 * one + 1] += taps[k] * x[one * step + k + 1];
            }
        }
        memcpy(out + 2 * n, sums, sizeof sums);
    }
    for (; n < count; n++) {
        float re = 0.0f, im = 0.0f;
        for (Py_ssize_t k = 0; k < length; k += 2) {
            re += taps[k] * samples[n * step + k];
            im += taps[k] * samples[n * step + k + 1];
        }
        out[2 * n] = re;
        out[2 * n + 1] = im;
    }
}

/* Largest magnitude of a real or imaginary part. */
VERSIONS static float largest_part(const float *values, Py_ssize_t count)
{
    float most[4 * LANES] = {0}, largest = 0.0f;
    Py_ssize_t i = 0;
    for (; i + 4 * LANES <= count; i += 4 * LANES)
        for (int k = 0; k < 4 * LANES; k++) {
            const float value = fabsf(values[i + k]);
            most[k] = value > most[k] ? value : most[k];
        }
    for (int k = 0; k < 4 * LANES; k++)
        largest = most[k] > largest ? most[k] : largest;
    for (; i < count; i++)
        largest = fabsf(values[i]) > largest ? fabsf(values[i]) : largest;
    return largest;
}

/* largest(samples) */
static PyObject *largest(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t count = 0;
    PyObject *result = NULL;
    if (!count_is(given, 1, "largest"))
        return NULL;
    const float *samples = hold(&held, args[0], 0, 8, 0, &count, "samples");
    if (samples != NULL)
        result = PyFloat_FromDouble(largest_part(samples, 2 * count));
    release(&held);
    return result;
}

/* decimate(samples, taps, factor, out): fills all of `out`. */
static PyObject *decimate(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t factor, length = 0, count = 0;
    PyObject *result = NULL;
    if (!count_is(given, 4, "decimate") || get_sizes(args + 2, &factor, 1) < 0)
        return NULL;
    const float *taps = hold(&held, args[1], 0, 4, 2, &length, "taps");
    if (taps == NULL)
        goto end;
    float *out = hold(&held, args[3], 1, 8, 0, &count, "out");
    if (out == NULL)
        goto end;
    if (factor < 1 || length % 2 || !fits(count, factor)) {
        PyErr_SetString(PyExc_ValueError, "decimate: no such factor or taps");
        goto end;
    }
    const Py_ssize_t needed = count ? (count - 1) * factor + length / 2 : 0;
    const float *samples = hold(&held, args[0], 0, 8, needed, NULL, "samples");
    if (samples == NULL)
        goto end;
    Py_BEGIN_ALLOW_THREADS
    decimate_outputs(samples, taps, length, factor, count, out);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

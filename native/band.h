/* A tag's narrow band and its spectrogram: uavrt.detection.grid. */
#include "common.h"

/* out[n] = turns[n] sum of taps[k] samples[factor n + k]; taps as two rows of
   `length` floats, a multiple of 16 and zeros at the end: the real parts twice each, then the
   imaginary ones. turns[n] is the product
   of a row's and of a place's within the row of eight. */
VERSIONS static void band_outputs(const float *samples, Py_ssize_t floats, const float *taps,
                                  Py_ssize_t length, Py_ssize_t factor, Py_ssize_t count,
                                  const float *rows, const float *places, Py_ssize_t in_row,
                                  float *out)
{
    const Py_ssize_t step = 2 * factor;
    const float *other = taps + length;
    for (Py_ssize_t n = 0; n < count; n += 2) {
        const int pair = n + 1 < count;
        const float *x = samples + n * step, *y = pair ? x + step : x;
        float sums[8] = {0};
        if ((n + pair) * step + length <= floats) {
            lanes_t a = {0}, b = {0}, c = {0}, d = {0};
            for (Py_ssize_t k = 0; k < length; k += LANES) {
                lanes_t re = LOAD(taps + k), im = LOAD(other + k);
                lanes_t first = LOAD(x + k), second = LOAD(y + k);
                a += re * first;
                b += im * first;
                c += re * second;
                d += im * second;
            }
            halves(a, sums, sums + 1);
            halves(b, sums + 2, sums + 3);
            halves(c, sums + 4, sums + 5);
            halves(d, sums + 6, sums + 7);
        } else {
            /* The taps end with zeros: no sample is missing for them. */
            for (int one = 0; one <= pair; one++) {
                const float *z = one ? y : x;
                const Py_ssize_t end = floats - (z - samples);
                for (Py_ssize_t k = 0; k < length && k < end; k += 2) {
                    sums[4 * one] += taps[k] * z[k];
                    sums[4 * one + 1] += taps[k] * z[k + 1];
                    sums[4 * one + 2] += other[k] * z[k];
                    sums[4 * one + 3] += other[k] * z[k + 1];
                }
            }
        }
        for (int one = 0; one <= pair; one++) {
            const float *s = sums + 4 * one;
            const float re = s[0] - s[3], im = s[1] + s[2];
            const float *row = rows + 2 * ((n + one) / in_row);
            const float *place = places + 2 * ((n + one) % in_row);
            const float tr = row[0] * place[0] - row[1] * place[1];
            const float ti = row[0] * place[1] + row[1] * place[0];
            out[2 * (n + one)] = re * tr - im * ti;
            out[2 * (n + one) + 1] = re * ti + im * tr;
        }
    }
}

#define MOST_WINDOW 128
/* Power of every cell: power[row][column]. With e(n) = x(n) + x(-n) and o(n) = x(n) - x(-n)
   around a window's middle the transform at +-f is A -+ jB, A the sum of e cos, B of o sin. */
VERSIONS static void cell_powers(const float *samples, Py_ssize_t hop, Py_ssize_t length,
                                 Py_ssize_t columns, const float *cosines, const float *sines,
                                 Py_ssize_t middle, Py_ssize_t stride, float *power,
                                 float *work, Py_ssize_t room)
{
    const Py_ssize_t half = length / 2, evens = length - half;
    /* Samples of one place of the hop side by side: then those of sixteen columns are. */
    float *parts = work;
    const Py_ssize_t total = (columns - 1) * hop + length;
    for (Py_ssize_t phase = 0; phase < hop; phase++) {
        float *re = parts + 2 * phase * room, *im = re + room;
        const Py_ssize_t own = (total - phase + hop - 1) / hop;
        for (Py_ssize_t n = 0; n < own; n++) {
            re[n] = samples[2 * (phase + n * hop)];
            im[n] = samples[2 * (phase + n * hop) + 1];
        }
        memset(re + own, 0, sizeof(float) * (room - own));
        memset(im + own, 0, sizeof(float) * (room - own));
    }
    lanes_t even[2][MOST_WINDOW], odd[2][MOST_WINDOW];
    for (Py_ssize_t first = 0; first < columns; first += LANES) {
        for (int part = 0; part < 2; part++) {
            const float *base = parts + part * room + first;
            for (Py_ssize_t n = 0; n < half; n++) {
                const Py_ssize_t late = length - half + n, early = half - 1 - n;
                lanes_t a = LOAD(base + 2 * (late % hop) * room + late / hop);
                lanes_t b = LOAD(base + 2 * (early % hop) * room + early / hop);
                even[part][n] = a + b;
                odd[part][n] = a - b;
            }
            if (evens > half)
                even[part][half] = LOAD(base + 2 * (half % hop) * room + half / hop);
        }
        const Py_ssize_t count = columns - first < LANES ? columns - first : LANES;
        for (Py_ssize_t row = 0; row <= middle; row++) {
            const float *c = cosines + row * evens, *s = sines + row * half;
            lanes_t a0 = {0}, a1 = {0}, b0 = {0}, b1 = {0};
            for (Py_ssize_t n = 0; n < half; n++) {
                a0 += c[n] * even[0][n];
                a1 += c[n] * even[1][n];
                b0 += s[n] * odd[0][n];
                b1 += s[n] * odd[1][n];
            }
            if (evens > half) {
                a0 += c[half] * even[0][half];
                a1 += c[half] * even[1][half];
            }
            lanes_t one = a0 - b1, two = a1 + b0;
            lanes_t below = one * one + two * two;
            one = a0 + b1;
            two = a1 - b0;
            lanes_t above = one * one + two * two;
            float *low = power + (middle - row) * stride + first;
            float *high = power + (middle + row) * stride + first;
            if (count == LANES) {
                STORE(low, below);
                STORE(high, above);
            } else {
                memcpy(low, &below, sizeof(float) * count);
                memcpy(high, &above, sizeof(float) * count);
            }
        }
    }
}

/* narrow(samples, taps, used, factor, rows, places, out, first): fills `out` from item `first`
   on; `used` of the taps are not zeros. */
static PyObject *narrow(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[2], first, length = 0, items = 0, row_count = 0, in_row = 0, have = 0;
    PyObject *result = NULL;
    if (!count_is(given, 8, "narrow") || get_sizes(args + 2, size, 2) < 0 ||
        get_sizes(args + 7, &first, 1) < 0)
        return NULL;
    const Py_ssize_t used = size[0], factor = size[1];
    const float *taps = hold(&held, args[1], 0, 4, 4, &length, "taps");
    if (taps == NULL)
        goto end;
    const float *rows = hold(&held, args[4], 0, 8, 0, &row_count, "rows");
    if (rows == NULL)
        goto end;
    const float *places = hold(&held, args[5], 0, 8, 1, &in_row, "places");
    if (places == NULL)
        goto end;
    float *out = hold(&held, args[6], 1, 8, 0, &items, "out");
    if (out == NULL)
        goto end;
    const Py_ssize_t count = items - first;
    if (factor < 1 || length % (2 * LANES) || used < 1 || used > length / 4 ||
        first < 0 || count < 0 || !fits(count, factor) ||
        count > row_count * in_row) {
        PyErr_SetString(PyExc_ValueError, "narrow: no such factor, taps or outputs");
        goto end;
    }
    length /= 2;
    const Py_ssize_t needed = count ? (count - 1) * factor + used : 0;
    const float *samples = hold(&held, args[0], 0, 8, needed, &have, "samples");
    if (samples == NULL)
        goto end;
    band_outputs(samples, 2 * have, taps, length, factor, count, rows, places, in_row, out + 2 * first);
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

/* powers(samples, hop, length, cosines, sines, power, first, columns, work): fills as many
   columns of `power`, rows of `columns` floats from item `first` on. */
static PyObject *powers(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[2], place[2];
    PyObject *result = NULL;
    if (!count_is(given, 9, "powers") || get_sizes(args + 1, size, 2) < 0 ||
        get_sizes(args + 6, place, 2) < 0)
        return NULL;
    const Py_ssize_t hop = size[0], length = size[1], first = place[0], columns = place[1];
    const Py_ssize_t half = length / 2, evens = length - half;
    Py_ssize_t coefficients = 0;
    if (hop < 1 || length < 2 || length > 2 * MOST_WINDOW - 2 || first < 0 || columns < 0 ||
        !fits(columns, hop)) {
        PyErr_SetString(PyExc_ValueError, "powers: no such hop, window or columns");
        return NULL;
    }
    const float *cosines = hold(&held, args[3], 0, 4, evens, &coefficients, "cosines");
    if (cosines == NULL)
        goto end;
    const Py_ssize_t middle = coefficients / evens - 1;
    const float *sines = hold(&held, args[4], 0, 4, (middle + 1) * half, NULL, "sines");
    if (sines == NULL)
        goto end;
    const Py_ssize_t needed = columns ? (columns - 1) * hop + length : 0;
    const float *samples = hold(&held, args[0], 0, 8, needed, NULL, "samples");
    if (samples == NULL)
        goto end;
    const Py_ssize_t room = columns + length / hop + 2 * LANES;
    if (!fits(columns, 2 * middle + 1)) {
        PyErr_SetString(PyExc_ValueError, "powers: too many columns");
        goto end;
    }
    float *power =
        hold(&held, args[5], 1, 4, first + (2 * middle + 1) * columns, NULL, "power");
    if (power == NULL)
        goto end;
    float *work = hold(&held, args[8], 1, 4, 2 * hop * room, NULL, "work");
    if (work == NULL)
        goto end;
    if (columns)
        cell_powers(samples, hop, length, columns, cosines, sines, middle, columns,
                    power + first, work, room);
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

/* A tag's narrow band and its spectrogram: uavrt.detection.search.grid. */
#include "loops.h"

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
    if (factor < 1 || length % (2 * MOST_LANES) || used < 1 || used > length / 4 ||
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
    loops->band_outputs(samples, 2 * have, taps, length, factor, count, rows, places, in_row,
                        out + 2 * first);
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
    const Py_ssize_t room = columns + length / hop + 2 * MOST_LANES;
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
        loops->cell_powers(samples, hop, length, columns, cosines, sines, middle, columns,
                           power + first, work, room);
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

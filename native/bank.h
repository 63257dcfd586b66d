/* The filter bank: windows weighted, folded, Fourier transformed, channels chosen.

   Its loops are in bank_loops.h. */
#include "loops.h"

/* bank(samples, weights, twiddles, chosen, channels, hop, odd, rows, out, first, work) */
static PyObject *bank(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[4], first, items = 0, choices = 0, places = 0;
    PyObject *result = NULL;
    if (!count_is(given, 11, "bank") || get_sizes(args + 4, size, 4) < 0 ||
        get_sizes(args + 9, &first, 1) < 0)
        return NULL;
    const Py_ssize_t channels = size[0], hop = size[1], odd = size[2], rows = size[3];
    if (channels < 2 || channels > 1 << 20 || hop < 1 || hop > channels || first < 0 ||
        rows < 0 || !fits(rows, hop)) {
        PyErr_SetString(PyExc_ValueError, "bank: no such channels, hop or outputs");
        return NULL;
    }
    const float *weights = hold(&held, args[1], 0, 4, 2 * channels, &items, "weights");
    if (weights == NULL)
        goto end;
    const Py_ssize_t phases = items / (2 * channels);
    const Py_ssize_t needed = rows ? (rows - 1) * hop + phases * channels : 0;
    const float *samples = hold(&held, args[0], 0, 8, needed, NULL, "samples");
    if (samples == NULL)
        goto end;
    const float *twiddles = hold(&held, args[2], 0, 8, channels, NULL, "twiddles");
    if (twiddles == NULL)
        goto end;
    const int32_t *chosen = hold(&held, args[3], 0, 4, 0, &choices, "chosen");
    if (chosen == NULL)
        goto end;
    float *out = hold(&held, args[8], 1, 8, 0, &places, "out");
    if (out == NULL)
        goto end;
    float *work = hold(&held, args[10], 1, 4, 6 * channels * MOST_LANES, NULL, "work");
    if (work == NULL)
        goto end;
    for (Py_ssize_t at = 0; at < choices; at++) {
        if (chosen[at] < 0 || chosen[at] >= channels) {
            PyErr_SetString(PyExc_ValueError, "bank: no such channel");
            goto end;
        }
    }
    const Py_ssize_t out_rows = choices ? places / choices : 0;
    if (choices && first + rows > out_rows) {
        PyErr_SetString(PyExc_ValueError, "bank: too little room for the outputs");
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    loops->bank_outputs(samples, weights, twiddles, chosen, channels, phases, hop, rows,
                        choices, (int)(odd & 1), out + 2 * first, out_rows, work);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

/* Filters that keep every D-th sample. */
#include "loops.h"

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
        result = PyFloat_FromDouble(loops->largest_part(samples, 2 * count));
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
    loops->decimate_outputs(samples, taps, length, factor, count, out);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

/* Spectrogram of a whole band: uavrt.detection.beeps.beep_points. */
#include "loops.h"

/* spectrogram(samples, hop, taper, twiddles, first, bins, work, out): power of as many windows
   as `out` has rows of `bins`. twiddles: exp(-2 pi i k / size), whose number is the size of
   the transforms, without prime factors above 5. work: 16 floats for each of them, and 16. */
static PyObject *spectrogram(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t hop, size[2], length = 0, points = 0, cells = 0;
    PyObject *result = NULL;
    if (!count_is(given, 8, "spectrogram") || get_sizes(args + 1, &hop, 1) < 0 ||
        get_sizes(args + 4, size, 2) < 0)
        return NULL;
    const Py_ssize_t first = size[0], bins = size[1];
    const float *taper = hold(&held, args[2], 0, 4, 1, &length, "taper");
    if (taper == NULL)
        goto end;
    const float *twiddles = hold(&held, args[3], 0, 8, length, &points, "twiddles");
    if (twiddles == NULL)
        goto end;
    float *out = hold(&held, args[7], 1, 4, 0, &cells, "out");
    if (out == NULL)
        goto end;
    Py_ssize_t rest = points;
    for (int prime = 2; prime <= 5; prime++)
        while (rest % prime == 0)
            rest /= prime;
    const Py_ssize_t windows = bins > 0 ? cells / bins : 0;
    if (rest != 1 || hop < 1 || first < 0 || first >= points || bins < 1 || bins > points ||
        cells % bins || windows < 1 || !fits(windows, hop) || !fits(points, 32)) {
        PyErr_SetString(PyExc_ValueError, "spectrogram: no such windows or frequencies");
        goto end;
    }
    float *work = hold(&held, args[6], 1, 4, 16 * points + 16, NULL, "work");
    if (work == NULL)
        goto end;
    work += (16 - (uintptr_t)work / sizeof *work % 16) % 16; /* lines of the cache begin there */
    const float *samples =
        hold(&held, args[0], 0, 8, (windows - 1) * hop + length, NULL, "samples");
    if (samples == NULL)
        goto end;
    Py_BEGIN_ALLOW_THREADS
    loops->window_powers(samples, hop, windows, taper, length, points, twiddles, first, bins,
                         work, out);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&held);
    return result;
}

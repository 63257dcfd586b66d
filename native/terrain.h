/* Profiles of the ground from one place to every cell of a grid. */
#include "loops.h"

/* The parameter of the one edge that stands for a profile (uavrt.localization.terrain.diffraction). */
static float edge_of(const view_t *view, double dx, double dy, float foot)
{
    const double far = sqrt(dx * dx + dy * dy);
    const double far_m = far * view->cell;
    const Py_ssize_t points = (Py_ssize_t)ceil(far);
    if (far_m < 1.0 || points < 2)
        return -10.0f;
    const double step = far_m / points;
    const double tag = foot - far_m * far_m * view->bulge + view->tag;
    const double rise = tag / points; /* of the straight ray, from point to point */
    float best[3];
    loops->profile(view, (float)(dx / points), (float)(dy / points), points, (float)tag,
                   (float)(step * step * view->bulge), best);
    if (best[0] < rise)
        return best[2] * (float)sqrt(2.0 * points / (view->wavelength * step));
    /* Out of sight: where the rays over both horizons meet, in points from the drone. */
    double both = (double)best[0] + best[1];
    both = both > 1e-9 * step ? both : 1e-9 * step;
    double at = (tag + (double)best[1] * points) / both;
    const double least = 1e-3 * points, most = 0.999 * points;
    at = at < least ? least : at > most ? most : at;
    const double above = (double)best[0] * at - tag * at / points;
    return (float)(above * sqrt(2.0 * points / (view->wavelength * step * at * (points - at))));
}

/* edges(height, columns, column, row, tag, cell, wavelength, bulge, first, out): the parameters
   of the rows from `first` on, as many as `out` holds. Heights are over the drone, which is at
   `column` and `row`; beyond the cells there are a column and a row more, for points between. */
static PyObject *edges(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t wide, first, cells = 0, count = 0;
    PyObject *result = NULL;
    float *tables = NULL;
    double numbers[6];
    if (!count_is(given, 10, "edges") || get_sizes(args + 1, &wide, 1) < 0 ||
        get_sizes(args + 8, &first, 1) < 0)
        return NULL;
    for (int i = 0; i < 6; i++) {
        numbers[i] = PyFloat_AsDouble(args[2 + i]);
        if (PyErr_Occurred())
            return NULL;
    }
    const float *height = hold(&held, args[0], 0, 4, 4, &cells, "height");
    if (height == NULL)
        goto end;
    float *out = hold(&held, args[9], 1, 4, 0, &count, "out");
    if (out == NULL)
        goto end;
    const Py_ssize_t high = wide > 1 ? cells / wide : 0, columns = wide - 1, rows = high - 1;
    if (high < 2 || high * wide != cells || cells >= INT32_MAX || first < 0 ||
        count % columns || count / columns > rows - first ||
        !(numbers[0] >= 0.0 && numbers[0] <= columns - 1) ||
        !(numbers[1] >= 0.0 && numbers[1] <= rows - 1)) {
        PyErr_SetString(PyExc_ValueError, "edges: no such rows or columns");
        goto end;
    }
    const Py_ssize_t most = (Py_ssize_t)ceil(sqrt((double)columns * columns + (double)rows * rows)) + 2;
    tables = malloc(4 * sizeof(float) * (most + 1));
    if (tables == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    const view_t view = {height, tables, most, (int32_t)wide, (float)numbers[0],
                         (float)numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]};
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t i = 1; i < most; i++) {
        tables[i] = tables[3 * most - i] = 1.0f / i;
        tables[most + i] = tables[4 * most - i] = 1.0f / sqrtf((float)i);
    }
    for (Py_ssize_t cell = 0; cell < count; cell++) {
        const Py_ssize_t row = first + cell / columns, column = cell % columns;
        out[cell] = edge_of(&view, column - numbers[0], row - numbers[1],
                            height[row * wide + column]);
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    free(tables);
    release(&held);
    return result;
}

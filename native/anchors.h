/* The search for anchors of one tag, and the test of their groups: uavrt.detection.search.anchors. */
#include "loops.h"

#define AHEAD 2

static int by_place(const void *one, const void *two)
{
    const anchor_t *a = one, *b = two;
    if (a->column != b->column)
        return a->column < b->column ? -1 : 1;
    return a->row < b->row ? -1 : a->row > b->row;
}

/* Put new columns into the ring; what lies twice is written twice. */
static void append_columns(float *cells, Py_ssize_t rows, Py_ssize_t width, Py_ssize_t length,
                           Py_ssize_t at, const char *power, Py_ssize_t step, Py_ssize_t count)
{
    const Py_ssize_t spare = width - length;
    for (Py_ssize_t row = 0; row < rows; row++) {
        /* The ring of a hundred tags lies in no cache, and each row on a page of its own:
           nothing but this fetches the rows ahead. */
        if (row + AHEAD < rows)
            for (Py_ssize_t i = 0; i < count; i += 16)
                __builtin_prefetch(cells + (row + AHEAD) * width + at + i, 1);
        const float *from = (const float *)(power + row * step);
        float *to = cells + row * width;
        memcpy(to + at, from, sizeof(float) * count);
        if (at + count > length)
            memcpy(to, from + (length - at), sizeof(float) * (at + count - length));
        if (at < spare) {
            const Py_ssize_t twice = count < spare - at ? count : spare - at;
            memcpy(to + length + at, from, sizeof(float) * twice);
        }
    }
}

/* note(memory, base, rows, width, length, pushed, at, fresh, first, reach, share, levels,
   power): put the columns `power` into the ring at `pushed` and look for anchors among the
   `fresh` columns from `at` on, which are counted from `first`.
   Returns lists of their columns, rows and powers, in the order of the columns. */
static PyObject *note(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[9];
    PyObject *result = NULL, *lists[3] = {NULL, NULL, NULL};
    anchor_t *found = NULL;
    if (!count_is(given, 13, "note") || get_sizes(args + 1, size, 9) < 0)
        return NULL;
    const Py_ssize_t base = size[0], rows = size[1], width = size[2], length = size[3];
    const Py_ssize_t pushed = size[4], at = size[5], fresh = size[6], first = size[7];
    const Py_ssize_t reach = size[8];
    const double share = PyFloat_AsDouble(args[10]);
    if (share == -1.0 && PyErr_Occurred())
        return NULL;
    if (base < 0 || rows < 0 || length < 1 || !fits(rows, width) || pushed < 0 ||
        pushed >= length || at < 0 || at >= length || fresh < 0 || fresh > length ||
        at + fresh > width || reach < 0 || reach > length ||
        width < length + 2 * reach + 1 || width > 2 * length) {
        PyErr_SetString(PyExc_ValueError, "note: no such ring");
        return NULL;
    }
    float *memory = hold(&held, args[0], 1, 4, base + rows * width, NULL, "memory");
    if (memory == NULL)
        goto end;
    const float *levels = hold(&held, args[11], 0, 4, rows, NULL, "levels");
    if (levels == NULL)
        goto end;
    Py_buffer *power = &held.view[held.count];
    if (PyObject_GetBuffer(args[12], power, PyBUF_STRIDES) < 0)
        goto end;
    held.count++;
    if (power->ndim != 2 || power->itemsize != 4 || power->shape[0] != rows ||
        (power->shape[1] > 1 && power->strides[1] != 4) || power->shape[1] > length ||
        pushed + power->shape[1] > width) {
        PyErr_SetString(PyExc_ValueError, "note: no such columns");
        goto end;
    }
    append_columns(memory + base, rows, width, length, pushed, power->buf, power->strides[0],
                   power->shape[1]);
    const Py_ssize_t count = loops->find_anchors(memory + base, rows, width, length, at, fresh,
                                                 reach, levels, (float)share, &found);
    if (count < 0) {
        PyErr_NoMemory();
        goto end;
    }
    qsort(found, count, sizeof(anchor_t), by_place);
    for (int which = 0; which < 3; which++) {
        lists[which] = PyList_New(count);
        if (lists[which] == NULL)
            goto end;
        for (Py_ssize_t i = 0; i < count; i++) {
            PyObject *item = which == 0   ? PyLong_FromSsize_t(first + found[i].column)
                             : which == 1 ? PyLong_FromSsize_t(found[i].row)
                                          : PyFloat_FromDouble(found[i].power);
            if (item == NULL || PyList_SetItem(lists[which], i, item) < 0)
                goto end;
        }
    }
    result = PyTuple_Pack(3, lists[0], lists[1], lists[2]);
end:
    for (int which = 0; which < 3; which++)
        Py_XDECREF(lists[which]);
    free(found);
    release(&held);
    return result;
}

/* rate(memory, base, rows, width, length, stretch, reach, limit, lows, rest, levels,
   columns, rows, powers, places, least): the best sum of all anchors, and for each that has
   `least` or more a tuple of its index, best sum, strength and interval. */
static PyObject *rate(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[6], low_items = 0, rest_items = 0;
    PyObject *result = NULL, *hits = NULL;
    float *work = NULL;
    const Py_ssize_t item = sizeof(Py_ssize_t);
    if (!count_is(given, 16, "rate") || get_sizes(args + 1, size, 6) < 0)
        return NULL;
    const Py_ssize_t base = size[0], rows = size[1], width = size[2], length = size[3];
    const Py_ssize_t stretch = size[4], reach = size[5];
    const double limit = PyFloat_AsDouble(args[7]);
    const double least = PyFloat_AsDouble(args[15]);
    if (PyErr_Occurred())
        return NULL;
    if (base < 0 || rows < 0 || length < 1 || !fits(rows, width) || reach < 0 ||
        reach > length || stretch < 2 * reach + 1 || stretch > length ||
        width < length + stretch) {
        PyErr_SetString(PyExc_ValueError, "rate: no such ring");
        return NULL;
    }
    const float *memory = hold(&held, args[0], 0, 4, base + rows * width, NULL, "memory");
    if (memory == NULL)
        goto end;
    const Py_ssize_t *lows = hold(&held, args[8], 0, item, 0, &low_items, "lows");
    if (lows == NULL)
        goto end;
    const Py_ssize_t *rest = hold(&held, args[9], 0, item, 0, &rest_items, "rest");
    if (rest == NULL)
        goto end;
    const float *levels = hold(&held, args[10], 0, 4, rows, NULL, "levels");
    if (levels == NULL)
        goto end;
    const Py_ssize_t count = PyList_Size(args[11]);
    if (count < 0)
        goto end;
    for (int which = 12; which < 15; which++) {
        if (PyList_Size(args[which]) != count) {
            if (!PyErr_Occurred())
                PyErr_SetString(PyExc_ValueError, "rate: lists of several lengths");
            goto end;
        }
    }
    /* lows has (places, others) items, rest (places, others, intervals); places - 1 = others. */
    Py_ssize_t others = 0;
    while ((others + 1) * others < low_items)
        others++;
    const Py_ssize_t intervals = low_items ? rest_items / low_items : 1;
    if ((others + 1) * others != low_items || low_items * intervals != rest_items ||
        intervals < 1) {
        PyErr_SetString(PyExc_ValueError, "rate: no such tables");
        goto end;
    }
    for (Py_ssize_t i = 0; i < rest_items; i++) {
        if (rest[i] < 0 || rest[i] > stretch - 2 * reach - 1) {
            PyErr_SetString(PyExc_ValueError, "rate: a place outside the stretch");
            goto end;
        }
    }
    work = malloc(sizeof(float) * (2 * intervals + stretch + 2 * MOST_LANES));
    hits = work == NULL ? PyErr_NoMemory() : PyList_New(0);
    double largest = -INFINITY;
    for (Py_ssize_t i = 0; hits != NULL && i < count; i++) {
        const Py_ssize_t column = PyLong_AsSsize_t(PyList_GetItem(args[11], i));
        const Py_ssize_t row = PyLong_AsSsize_t(PyList_GetItem(args[12], i));
        const double power = PyFloat_AsDouble(PyList_GetItem(args[13], i));
        const Py_ssize_t place = PyLong_AsSsize_t(PyList_GetItem(args[14], i));
        if (!PyErr_Occurred() && (row < 0 || row >= rows || place < 0 || place > others))
            PyErr_SetString(PyExc_ValueError, "rate: no such row or place");
        if (PyErr_Occurred())
            goto end;
        const sum_t sum = loops->best_sum(
            memory + base + row * width, length, column, (float)power, levels[row],
            others ? levels[row] * (float)limit : INFINITY, lows + place * others,
            rest + place * others * intervals, others, intervals, stretch, reach, work);
        largest = sum.best > largest ? sum.best : largest;
        if (sum.best >= (float)least) {
            PyObject *hit = Py_BuildValue("(nddn)", i, (double)sum.best, (double)sum.strength,
                                          sum.interval);
            const int failed = hit == NULL || PyList_Append(hits, hit) < 0;
            Py_XDECREF(hit);
            if (failed)
                goto end;
        }
    }
    if (hits != NULL)
        result = Py_BuildValue("(dO)", largest, hits);
end:
    Py_XDECREF(hits);
    free(work);
    release(&held);
    return result;
}

/* Bursts of coded tags among cells: uavrt.detection.coded.sums. */
#include "loops.h"

typedef struct {
    int32_t code, row, stretch, column, sum;
} seed_t;

/* Add a seed; -1 when there is no memory. */
static int add_seed(seed_t **seeds, Py_ssize_t *count, Py_ssize_t *room, seed_t one)
{
    if (*count == *room) {
        const Py_ssize_t more = *room ? 2 * *room : 1024;
        seed_t *grown = realloc(*seeds, sizeof(seed_t) * more);
        if (grown == NULL)
            return -1;
        *seeds = grown;
        *room = more;
    }
    (*seeds)[(*count)++] = one;
    return 0;
}

/* seeds(cells, rows, width, first, count, offsets, codes, stretches, pulses, clip, level,
   apart): sums of `pulses` cells, each at most `clip`, at the columns `offsets` (codes,
   stretches, pulses) from each of `count` columns from `first` on. Returns bytes of int32: code,
   row, stretch, column and sum, where a sum reaches `level` and is the largest of its row
   within `apart` columns. */
static PyObject *seeds(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t size[4], last[6];
    if (!count_is(given, 12, "seeds") || get_sizes(args + 1, size, 4) < 0 ||
        get_sizes(args + 6, last, 6) < 0)
        return NULL;
    const Py_ssize_t rows = size[0], width = size[1], first = size[2], count = size[3];
    const Py_ssize_t codes = last[0], stretches = last[1], pulses = last[2];
    const Py_ssize_t clip = last[3], level = last[4], apart = last[5];
    PyObject *result = NULL;
    seed_t *found = NULL;
    uint8_t *work = NULL;
    Py_ssize_t number = 0, room = 0;
    if (!fits(rows, width) || !fits(codes, stretches) || pulses < 1 || pulses > 8 ||
        !fits(codes * stretches, pulses) || apart < 0 || apart > 1000 || first < apart ||
        count < 0 || count > width || clip < 0 || clip * pulses > 255 || level < 1) {
        PyErr_SetString(PyExc_ValueError, "seeds: no such cells");
        return NULL;
    }
    const uint8_t *cells = hold(&held, args[0], 0, 1, rows * width, NULL, "cells");
    if (cells == NULL)
        goto end;
    const int32_t *offsets =
        hold(&held, args[5], 0, 4, codes * stretches * pulses, NULL, "offsets");
    if (offsets == NULL)
        goto end;
    for (Py_ssize_t i = 0; i < codes * stretches * pulses; i++)
        if (offsets[i] < 0 || offsets[i] + first + count + apart > width) {
            PyErr_SetString(PyExc_ValueError, "seeds: an offset beyond the cells");
            goto end;
        }
    const Py_ssize_t length = count + 2 * apart;
    work = malloc(2 * length + 64);
    if (work == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    for (Py_ssize_t code = 0; code < codes; code++)
        for (Py_ssize_t row = 0; row < rows; row++) {
            const uint8_t *line = cells + row * width + first - apart;
            const int32_t *of_code = offsets + code * stretches * pulses;
            loops->code_sums(line, length, of_code, stretches, pulses, (uint8_t)clip, work,
                             work + length);
            for (Py_ssize_t i = apart; i < count + apart; i++) {
                if (work[i] < level)
                    continue;
                int best = 1;
                for (Py_ssize_t k = 1; k <= apart && best; k++)
                    best = work[i - k] < work[i] && work[i + k] <= work[i];
                if (!best)
                    continue;
                seed_t one = {(int32_t)code, (int32_t)row, 0, (int32_t)(first - apart + i), 0};
                for (Py_ssize_t s = 0; s < stretches; s++) {
                    int sum = 0;
                    for (Py_ssize_t p = 0; p < pulses; p++) {
                        const int cell = line[i + of_code[s * pulses + p]];
                        sum += cell < clip ? cell : (int)clip;
                    }
                    if (sum > one.sum) {
                        one.sum = sum;
                        one.stretch = (int32_t)s;
                    }
                }
                if (add_seed(&found, &number, &room, one) < 0) {
                    PyErr_NoMemory();
                    goto end;
                }
            }
        }
    result = PyBytes_FromStringAndSize((const char *)found, sizeof(seed_t) * number);
end:
    free(work);
    free(found);
    release(&held);
    return result;
}

#define MOST_BURSTS 128 /* 127 * 255 fits into 16 bits */
#define MOST_REACH 1024

/* folds(cells, rows, width, seeds, count, offsets, stretches, pulses, intervals, reach, steps,
   bursts, clip, out): the best sum of `bursts` bursts in a row that hold each seed (as `seeds`
   gives them), over `2 * steps + 1` intervals up to `reach` columns shorter or longer than
   `intervals` (codes, float32). out (count, 3) int32: sum, interval and the first burst's place
   from the seed's. Bursts beyond the cells count nothing. */
static PyObject *folds(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    PyObject *result = NULL;
    uint8_t *work = NULL;
    int32_t *places = NULL;
    int16_t *sums_of = NULL;
    Py_ssize_t rows, width, count, stretches, pulses, steps, bursts, clip, items, codes;
    if (!count_is(given, 14, "folds") || get_sizes(args + 1, &rows, 1) < 0 ||
        get_sizes(args + 2, &width, 1) < 0 || get_sizes(args + 4, &count, 1) < 0 ||
        get_sizes(args + 6, &stretches, 1) < 0 || get_sizes(args + 7, &pulses, 1) < 0 ||
        get_sizes(args + 10, &steps, 1) < 0 || get_sizes(args + 11, &bursts, 1) < 0 ||
        get_sizes(args + 12, &clip, 1) < 0)
        return NULL;
    const double reach = PyFloat_AsDouble(args[9]);
    if (PyErr_Occurred())
        return NULL;
    const Py_ssize_t most = bursts - 1;
    if (!fits(rows, width) || !fits(count, 5) || stretches < 1 || stretches > 1000 ||
        pulses < 1 || pulses > 8 || clip < 0 || clip * pulses > 255 || bursts < 2 ||
        bursts > MOST_BURSTS || steps < 0 || steps > 4096 || !(reach >= 0.0) ||
        !(reach * most + 2.0 < MOST_REACH)) {
        PyErr_SetString(PyExc_ValueError, "folds: no such bursts");
        return NULL;
    }
    const uint8_t *cells = hold(&held, args[0], 0, 1, rows * width, NULL, "cells");
    const seed_t *seed = cells ? hold(&held, args[3], 0, 4, 5 * count, NULL, "seeds") : NULL;
    const int32_t *offsets = seed ? hold(&held, args[5], 0, 4, 0, &items, "offsets") : NULL;
    const float *intervals = offsets ? hold(&held, args[8], 0, 4, 0, &codes, "intervals") : NULL;
    int32_t *out = intervals ? hold(&held, args[13], 1, 4, 3 * count, NULL, "out") : NULL;
    if (out == NULL)
        goto end;
    if (items / stretches / pulses < codes) {
        PyErr_SetString(PyExc_ValueError, "folds: too few offsets");
        goto end;
    }
    const Py_ssize_t room = 2 * MOST_REACH, intervals_tried = 2 * steps + 1;
    work = malloc((2 * most + 1) * room);
    places = malloc(sizeof(int32_t) * (2 * most + 1) * intervals_tried);
    sums_of = malloc(sizeof(int16_t) * (2 * most + 2) * intervals_tried);
    if (work == NULL || places == NULL || sums_of == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    for (Py_ssize_t j = -most; j <= most; j++)
        for (Py_ssize_t k = -steps; k <= steps; k++)
            places[(j + most) * intervals_tried + k + steps] =
                MOST_REACH + (int32_t)floor(j * (steps ? reach * k / steps : 0.0) + 0.5);
    for (Py_ssize_t n = 0; n < count; n++) {
        const seed_t one = seed[n];
        out[3 * n] = out[3 * n + 1] = out[3 * n + 2] = 0;
        if (one.code < 0 || one.code >= codes || one.row < 0 || one.row >= rows ||
            one.stretch < 0 || one.stretch >= stretches) {
            PyErr_SetString(PyExc_ValueError, "folds: no such seed");
            goto end;
        }
        const int32_t *own = offsets + (one.code * stretches + one.stretch) * pulses;
        const uint8_t *line = cells + one.row * width;
        for (Py_ssize_t j = -most; j <= most; j++) {
            const Py_ssize_t half = (Py_ssize_t)(reach * (j < 0 ? -j : j)) + 2;
            const Py_ssize_t from =
                one.column + (Py_ssize_t)floor(j * (double)intervals[one.code] + 0.5) - half;
            uint8_t *sums = work + (j + most) * room + MOST_REACH - half;
            int inside = 1;
            for (Py_ssize_t p = 0; p < pulses; p++)
                inside &= from + own[p] >= 0 && from + own[p] + 2 * half + 1 <= width;
            memset(sums, 0, 2 * half + 1);
            for (Py_ssize_t p = 0; inside && p < pulses; p++)
                loops->code_add(line + from + own[p], 2 * half + 1, (uint8_t)clip, sums);
        }
        loops->code_windows(work, room, places, intervals_tried, bursts, sums_of, out + 3 * n);
        out[3 * n + 1] -= (int32_t)steps;
        out[3 * n + 2] -= (int32_t)most;
    }
    Py_INCREF(Py_None);
    result = Py_None;
end:
    free(work);
    free(places);
    free(sums_of);
    release(&held);
    return result;
}

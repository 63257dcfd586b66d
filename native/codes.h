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

/* Whether a sum is the largest within `apart` columns. */
static int is_top(const uint8_t *sum, Py_ssize_t apart)
{
    for (Py_ssize_t k = 1; k <= apart; k++)
        if (sum[-k] >= *sum || sum[k] > *sum)
            return 0;
    return 1;
}

/* The first of the stretches whose sum is the largest. */
static seed_t best_stretch(const uint8_t *line, const int32_t *offsets, Py_ssize_t stretches,
                           Py_ssize_t pulses)
{
    seed_t best = {0};
    for (Py_ssize_t s = 0; s < stretches; s++) {
        int sum = 0;
        for (Py_ssize_t p = 0; p < pulses; p++)
            sum += line[offsets[s * pulses + p]];
        if (sum > best.sum) {
            best.sum = sum;
            best.stretch = (int32_t)s;
        }
    }
    return best;
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
    uint8_t *lines = NULL;
    Py_ssize_t number = 0, room = 0, beyond = 0;
    if (!fits(rows, width) || !fits(codes, stretches) || pulses < 1 || pulses > 8 ||
        !fits(codes * stretches, pulses) || apart < 0 || apart > 1000 || first < apart ||
        count < 0 || count > width || first > width - count - apart || clip < 0 ||
        clip * pulses > 255 || level < 1) {
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
    for (Py_ssize_t i = 0; i < codes * stretches * pulses; i++) {
        if (offsets[i] < 0 || offsets[i] + first + count + apart > width) {
            PyErr_SetString(PyExc_ValueError, "seeds: an offset beyond the cells");
            goto end;
        }
        beyond = offsets[i] > beyond ? offsets[i] : beyond;
    }
    /* The cells that count, limited once for all codes; zeros fill up the last block. */
    const Py_ssize_t length = count + 2 * apart, blocks = (length + CODE_BLOCK - 1) / CODE_BLOCK;
    const Py_ssize_t stride = blocks * CODE_BLOCK + beyond;
    lines = calloc(rows * stride + blocks * CODE_BLOCK + 1, 1);
    if (lines == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    uint8_t *work = lines + rows * stride;
    for (Py_ssize_t row = 0; row < rows; row++)
        loops->code_clip(cells + row * width + first - apart, length + beyond, (uint8_t)clip,
                         lines + row * stride);
    for (Py_ssize_t code = 0; code < codes; code++)
        for (Py_ssize_t row = 0; row < rows; row++) {
            const int32_t *of_code = offsets + code * stretches * pulses;
            const uint8_t *line = lines + row * stride;
            loops->code_sums(line, blocks, of_code, stretches, pulses, work);
            for (Py_ssize_t begin = 0; begin < count + apart; begin += CODE_BLOCK) {
                if (loops->code_highest(work + begin) < level)
                    continue;
                const Py_ssize_t end = begin + CODE_BLOCK;
                const Py_ssize_t upto = end < count + apart ? end : count + apart;
                for (Py_ssize_t i = begin > apart ? begin : apart; i < upto; i++) {
                    if (work[i] < level || !is_top(work + i, apart))
                        continue;
                    seed_t one = best_stretch(line + i, of_code, stretches, pulses);
                    one.code = (int32_t)code;
                    one.row = (int32_t)row;
                    one.column = (int32_t)(first - apart + i);
                    if (add_seed(&found, &number, &room, one) < 0) {
                        PyErr_NoMemory();
                        goto end;
                    }
                }
            }
        }
    result = PyBytes_FromStringAndSize((const char *)found, sizeof(seed_t) * number);
end:
    free(lines);
    free(found);
    release(&held);
    return result;
}

#define MOST_BURSTS 128 /* 127 * 255 fits into 16 bits */
#define MOST_REACH 1024
#define MOST_SPREAD 32 /* columns on which CODE_PLACES intervals lie in any line */

/* Where `folds` works. */
typedef struct {
    Py_ssize_t most, room, parts;
    uint8_t *sums, *places, *picked;
    int32_t *starts;
    int16_t *window;
} folding_t;

/* Room for all lines; NULL when there is no memory. */
static int make_folding(folding_t *own, Py_ssize_t bursts, Py_ssize_t intervals)
{
    own->most = bursts - 1;
    own->room = 2 * MOST_REACH + 2 * CODE_PART;
    own->parts = (intervals + CODE_PLACES - 1) / CODE_PLACES;
    const Py_ssize_t lines = 2 * own->most + 1, width = own->parts * CODE_PLACES;
    own->sums = calloc(lines * own->room + 2 * lines * width, 1);
    own->starts = malloc(sizeof(int32_t) * lines * own->parts);
    own->window = malloc(sizeof(int16_t) * width);
    if (own->sums == NULL || own->starts == NULL || own->window == NULL)
        return -1;
    own->places = own->sums + lines * own->room;
    own->picked = own->places + lines * width;
    return 0;
}

/* Lay out where each line has the intervals; -1 where they lie too far apart. */
static int lay_out(folding_t *own, Py_ssize_t steps, double reach)
{
    const Py_ssize_t last = 2 * steps, lines = 2 * own->most + 1;
    for (Py_ssize_t at = 0; at < lines * own->parts; at++) {
        const Py_ssize_t line = at / own->parts, begin = at % own->parts * CODE_PLACES;
        int32_t place[CODE_PLACES], lowest = INT32_MAX;
        for (int i = 0; i < CODE_PLACES; i++) {
            const Py_ssize_t k = (begin + i < last ? begin + i : last) - steps;
            const double off = steps ? reach * k / steps : 0.0;
            place[i] = MOST_REACH + (int32_t)floor((line - own->most) * off + 0.5);
            lowest = place[i] < lowest ? place[i] : lowest;
        }
        own->starts[at] = lowest;
        for (int i = 0; i < CODE_PLACES; i++) {
            if (place[i] - lowest >= MOST_SPREAD)
                return -1;
            own->places[at * CODE_PLACES + i] = (uint8_t)(place[i] - lowest);
        }
    }
    return 0;
}

/* Sum the bursts about a seed that lie `line - most` intervals from it. */
static void sum_line(folding_t *own, Py_ssize_t line, const uint8_t *cells, Py_ssize_t width,
                     Py_ssize_t beyond, Py_ssize_t first, Py_ssize_t half,
                     const int32_t *offsets, Py_ssize_t pulses, uint8_t clip)
{
    uint8_t *sums = own->sums + line * own->room + MOST_REACH - half;
    const Py_ssize_t length = 2 * half + 1, parts = (length + CODE_PART - 1) / CODE_PART;
    Py_ssize_t furthest = 0;
    int inside = 1;
    for (Py_ssize_t p = 0; p < pulses; p++) {
        inside &= first + offsets[p] >= 0 && first + offsets[p] + length <= width;
        furthest = offsets[p] > furthest ? offsets[p] : furthest;
    }
    if (!inside)
        memset(sums, 0, length);
    else if (first + furthest + parts * CODE_PART <= beyond)
        loops->code_add(cells + first, parts, offsets, pulses, clip, sums);
    else
        for (Py_ssize_t i = 0; i < length; i++) {
            sums[i] = 0;
            for (Py_ssize_t p = 0; p < pulses; p++) {
                const uint8_t cell = cells[first + offsets[p] + i];
                sums[i] = (uint8_t)(sums[i] + (cell < clip ? cell : clip));
            }
        }
}

/* folds(cells, rows, width, seeds, count, offsets, stretches, pulses, intervals, reach, steps,
   bursts, clip, out): the best sum of `bursts` bursts in a row that hold each seed (as `seeds`
   gives them), over `2 * steps + 1` intervals up to `reach` columns shorter or longer than
   `intervals` (codes, float32); the last burst moves by two columns at most from one to the
   next. out (count, 3) int32: sum, interval and the first burst's place from the seed's. Bursts
   beyond the cells count nothing. */
static PyObject *folds(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    folding_t own = {0};
    PyObject *result = NULL;
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
    if (!fits(rows, width) || !fits(count, 5) || stretches < 1 || stretches > 1000 ||
        pulses < 1 || pulses > 8 || clip < 0 || clip * pulses > 255 || bursts < 2 ||
        bursts > MOST_BURSTS || steps < 0 || steps > 4096 || !(reach >= 0.0) ||
        !(reach * (bursts - 1) + 2.0 < MOST_REACH)) {
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
    if (make_folding(&own, bursts, 2 * steps + 1) < 0) {
        PyErr_NoMemory();
        goto end;
    }
    if (lay_out(&own, steps, reach) < 0) {
        PyErr_SetString(PyExc_ValueError, "folds: intervals too far apart");
        goto end;
    }
    for (Py_ssize_t n = 0; n < count; n++) {
        const seed_t one = seed[n];
        if (one.code < 0 || one.code >= codes || one.row < 0 || one.row >= rows ||
            one.stretch < 0 || one.stretch >= stretches) {
            PyErr_SetString(PyExc_ValueError, "folds: no such seed");
            goto end;
        }
        const int32_t *of_code = offsets + (one.code * stretches + one.stretch) * pulses;
        for (Py_ssize_t line = 0; line <= 2 * own.most; line++) {
            const Py_ssize_t j = line - own.most;
            const Py_ssize_t half = (Py_ssize_t)(reach * (j < 0 ? -j : j)) + 2;
            const Py_ssize_t middle =
                one.column + (Py_ssize_t)floor(j * (double)intervals[one.code] + 0.5);
            sum_line(&own, line, cells + one.row * width, width, (rows - one.row) * width,
                     middle - half, half, of_code, pulses, (uint8_t)clip);
        }
        loops->code_windows(own.sums, own.room, own.starts, own.places, own.parts, bursts,
                            own.picked, own.window, out + 3 * n);
        out[3 * n + 1] -= (int32_t)steps;
        out[3 * n + 2] -= (int32_t)own.most;
    }
    Py_INCREF(Py_None);
    result = Py_None;
end:
    free(own.sums);
    free(own.starts);
    free(own.window);
    release(&held);
    return result;
}

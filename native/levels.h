/* How loud the noise is at each instant: uavrt.detection.search.levelling, whose names these are. */
#include "loops.h"

/* As in levelling.py, and HOPS_PER_PULSE, ROWS_PER_BIN of uavrt/detection/search/grid.py. */
#define SLOT 4
#define ROWS_PER_BIN 4
#define TRUNCATION 4.0f
#define MEAN 0.98168436f /* 1 - exp(-TRUNCATION) */
#define VARIANCE 1.5
#define TRIGGER 3.0
#define BAND_TRIGGER 3.6
#define CALM 11
#define BURST 1.7f
#define BURST_SIGMAS 2.6
#define NEAR 4
#define FAR 8
#define AHEAD 10
#define MOST_MARGIN 0.3
#define SAME 0.12f
#define STAYED 40
#define SIGMAS 2.2
#define MOST_SPLITS 4
#define SPLIT 6.5
#define LEAST 1e-9
static const int stretches[] = {6, 10, 16, 26, 42, 80};

INLINE double larger(double a, double b) { return a > b ? a : b; }
INLINE double smaller(double a, double b) { return a < b ? a : b; }

/* Natural logarithm of a positive number, to 1e-15: libm's binds a wheel to a newer glibc. */
INLINE double logarithm(double value)
{
    union {
        double value;
        uint64_t bits;
    } parts = {.value = value};
    /* The mantissa between 1/sqrt(2) and sqrt(2); then twice the area tangent's series. */
    const uint64_t root = 0x3FE6A09E667F3BCD;
    const int64_t power = (int64_t)(parts.bits - root) >> 52;
    parts.bits -= (uint64_t)power << 52;
    const double s = (parts.value - 1.0) / (parts.value + 1.0), t = s * s;
    double sum = 1.0 / 19.0;
    for (int n = 17; n > 0; n -= 2)
        sum = sum * t + 1.0 / n;
    return 0.69314718055994531 * (double)power + 2.0 * s * sum;
}

/* Means of each band's new cells, limited by its newest level: both[band][past + slot]. */
static void new_slots(const char *power, Py_ssize_t step, const float *noise, Py_ssize_t rows,
                      const float *now, Py_ssize_t bands, float *both, Py_ssize_t slots,
                      Py_ssize_t count)
{
    for (Py_ssize_t band = 0; band < bands; band++) {
        const Py_ssize_t first = band * ROWS_PER_BIN;
        const Py_ssize_t end = band + 1 < bands ? first + ROWS_PER_BIN : rows;
        const float limit = TRUNCATION * now[band], scale = 1.0f / (MEAN * (end - first));
        float *out = both + band * slots + slots - count;
        memset(out, 0, sizeof(float) * count);
        for (Py_ssize_t row = first; row < end; row++) {
            const float *cells = (const float *)(power + row * step);
            const float part = 1.0f / noise[row];
            for (Py_ssize_t slot = 0; slot < count; slot++) {
                const float cell = cells[SLOT * slot] * part;
                out[slot] += cell < limit ? cell : limit;
            }
        }
        for (Py_ssize_t slot = 0; slot < count; slot++)
            out[slot] *= scale;
    }
}

/* Mean over the bands, weighted by their rows. */
static void mean_of_bands(const float *both, const float *members, Py_ssize_t bands,
                          Py_ssize_t slots, float *common)
{
    float all = 0.0f;
    for (Py_ssize_t band = 0; band < bands; band++)
        all += members[band];
    memset(common, 0, sizeof(float) * slots);
    for (Py_ssize_t band = 0; band < bands; band++) {
        const float share = members[band] / all, *line = both + band * slots;
        for (Py_ssize_t slot = 0; slot < slots; slot++)
            common[slot] += share * line[slot];
    }
}

/* Whether one level may be that of all slots; `mean` becomes it and `total` the slots that
   count. `work` holds slots and bands. */
static int is_steady(const float *both, const float *weights, const float *members,
                     Py_ssize_t bands, Py_ssize_t slots, double bins, double *mean,
                     double *total, float *work)
{
    float *common = work, *tall = work + slots;
    mean_of_bands(both, members, bands, slots, common);
    double sum = 0.0, count = 0.0;
    for (Py_ssize_t slot = 0; slot < slots; slot++) {
        sum += common[slot] * weights[slot];
        count += weights[slot];
    }
    const double all = *total = larger(count, 1.0), level = *mean = larger(sum / all, LEAST);
    const double scale = TRIGGER * sqrt(VARIANCE / bins) * level;
    Py_ssize_t pieces = slots / CALM, piece = CALM;
    for (int round = 0; round < 3; round++) {
        for (Py_ssize_t at = slots - pieces * piece; at < slots; at += piece) {
            double own = 0.0, some = 0.0;
            for (Py_ssize_t slot = at; slot < at + piece; slot++) {
                own += common[slot] * weights[slot];
                some += weights[slot];
            }
            if (!(fabs(own - some * level) <= scale * sqrt(larger(some, 1.0))))
                return 0;
        }
        pieces /= 2;
        piece *= 2;
        if (pieces < 2)
            break;
    }
    double height = 0.0;
    for (Py_ssize_t band = 0; band < bands; band++) {
        double own = 0.0;
        for (Py_ssize_t slot = 0; slot < slots; slot++)
            own += both[band * slots + slot] * weights[slot];
        height += own / (all * level) - 1.0;
        tall[band] = (float)height;
    }
    const double error = BAND_TRIGGER * sqrt(VARIANCE * ROWS_PER_BIN / members[0] / all);
    for (int width = 1; width <= 7 && width <= bands / 2 + 1; width += width == 1 ? 2 : 4)
        for (Py_ssize_t band = width - 1; band < bands; band++) {
            const float before = band >= width ? tall[band - width] : 0.0f;
            if (!(fabs(tall[band] - before) <= error * sqrt(width)))
                return 0;
        }
    return 1;
}

/* Note a newest level: average it with those before if it is the same. */
static Py_ssize_t average(const float *now, float *usual, Py_ssize_t bands, Py_ssize_t stayed)
{
    stayed = stayed + 1 < STAYED ? stayed + 1 : STAYED;
    for (Py_ssize_t band = 0; band < bands; band++)
        if (fabsf(now[band] - usual[band]) > SAME * usual[band])
            stayed = 1;
    for (Py_ssize_t band = 0; band < bands; band++)
        usual[band] += (now[band] - usual[band]) / (float)stayed;
    return stayed;
}

static float median_of_five(const float *values, Py_ssize_t slots, Py_ssize_t first)
{
    float five[NEAR + 1];
    for (int i = 0; i <= FAR - NEAR; i++) {
        /* Nothing is known of what comes; before the first slot it was as after it. */
        Py_ssize_t at = first + i < 0 ? -(first + i) : first + i;
        const float value = values[at < slots ? at : slots - 1];
        int place = i;
        for (; place > 0 && five[place - 1] > value; place--)
            five[place] = five[place - 1];
        five[place] = value;
    }
    return five[(FAR - NEAR) / 2];
}

/* Give strong pulses no weight; `doubtful` are the newest slots that may yet be such. */
static int take_out_bursts(const float *common, float *weights, Py_ssize_t slots, double bins,
                           char *doubtful)
{
    const double burst =
        smaller(1.0 + BURST_SIGMAS * sqrt(VARIANCE / bins), (double)BURST);
    int any = 0;
    for (Py_ssize_t slot = 0; slot < slots; slot++) {
        doubtful[slot] = 0;
        const double left = common[slot > 0 ? slot - 1 : 0];
        const double right = common[slot + 1 < slots ? slot + 1 : slots - 1];
        const double three = (left + common[slot] + right) * (1.0 / 3.0);
        const float before = median_of_five(common, slots, slot - FAR);
        if (!(common[slot] > BURST * before || three > (float)burst * before))
            continue;
        any |= doubtful[slot] = slot >= slots - FAR;
        const float after = median_of_five(common, slots, slot + NEAR);
        if (common[slot] > BURST * after || three > (float)burst * after)
            weights[slot] = 0.0f;
    }
    return any;
}

/* Mean over the longest stretch back from each slot (`ahead`: forward) that agrees with all
   shorter ones; `edge` is its other end, `least` what the loudest of these is less its error. */
static void longest(const float *common, const double *sums, const double *total,
                    Py_ssize_t slots, double scale, int ahead, double *mean, Py_ssize_t *edge,
                    double *least)
{
    for (Py_ssize_t slot = 0; slot < slots; slot++) {
        double low = 0.0, high = INFINITY, most = 0.0, best = common[slot];
        Py_ssize_t furthest = ahead ? slot + 1 : slot;
        for (unsigned i = 0; i < sizeof stretches / sizeof stretches[0]; i++) {
            Py_ssize_t begin = slot, end = slot + 1;
            if (ahead)
                end = slot + stretches[i] < slots ? slot + stretches[i] : slots;
            else
                begin = end > stretches[i] ? end - stretches[i] : 0;
            const double some = total[end] - total[begin];
            const double here =
                some > 0.0 ? (sums[end] - sums[begin]) / larger(some, 1e-9) : best;
            double error = scale / sqrt(larger(some, 1e-9));
            const double surely = here * (1.0 - error);
            error *= SIGMAS;
            low = larger(low, here * (1.0 - error));
            high = smaller(high, here * (1.0 + error));
            if (low > high)
                break; /* a longer one may reach back to before a fall */
            most = larger(most, surely);
            best = here;
            furthest = ahead ? end : begin;
        }
        mean[slot] = best;
        edge[slot] = furthest;
        if (least != NULL)
            least[slot] = most;
    }
}

/* Split the bands of one slot where their levels differ, and dilate the louder side by one
   band: means[band]. `sums` are those of the bands before each, `work` holds 2 bands. */
static void segments(const double *sums, Py_ssize_t bands, double cells, int circular,
                     double *means, Py_ssize_t *begin, Py_ssize_t *end)
{
    for (Py_ssize_t band = 0; band < bands; band++) {
        begin[band] = 0;
        end[band] = bands;
    }
    for (int round = 0; round < MOST_SPLITS; round++) {
        double most = -INFINITY;
        Py_ssize_t at = 1;
        for (Py_ssize_t split = 1; split < bands; split++) {
            const Py_ssize_t low = begin[split], high = end[split];
            const double below = split - low, above = high - split, width = high - low;
            double gain = 0.0;
            if (split > low) {
                const double first = (sums[split] - sums[low]) / below;
                const double second = (sums[high] - sums[split]) / above;
                const double whole = (sums[high] - sums[low]) / width;
                gain = width * logarithm(whole) -
                       (below * logarithm(larger(first, 1e-9)) + above * logarithm(second));
            }
            if (gain > most) {
                most = gain;
                at = split;
            }
        }
        if (!(most * cells > SPLIT))
            break;
        const Py_ssize_t low = begin[at], high = end[at];
        for (Py_ssize_t band = low; band < at; band++)
            end[band] = at;
        for (Py_ssize_t band = at; band < high; band++)
            begin[band] = at;
    }
    for (Py_ssize_t band = 0; band < bands; band++)
        means[band] = (sums[end[band]] - sums[begin[band]]) / (end[band] - begin[band]);
    const double first = means[0], last = means[bands - 1];
    double before = means[0];
    for (Py_ssize_t band = 0; band < bands; band++) {
        const double own = means[band], after = band + 1 < bands ? means[band + 1] : own;
        means[band] = larger(own, larger(before, after));
        before = own;
    }
    if (circular) {
        means[0] = larger(means[0], last);
        means[bands - 1] = larger(means[bands - 1], first);
    }
}

/* What `levels` works with. */
typedef struct {
    const float *both, *common;
    Py_ssize_t bands, slots, past;
    double bins, steepness;
    int circular;
    double *sums, *total, *back, *ahead, *least, *of_band, *means;
    Py_ssize_t *begin, *end, *split_begin, *split_end;
} levels_t;

/* Level of each slot; with `margin` (from slot `past` on) what to search with over that;
   levels of the bands over the common one from slot `past` on. Whether the bands differ. */
static int levels(const levels_t *at, const float *weights, float *level, float *margin,
                  float *of_bands)
{
    const Py_ssize_t slots = at->slots, count = slots - at->past;
    const double scale = sqrt(VARIANCE / at->bins);
    double *sums = at->sums, *total = at->total, *back = at->back, *ahead = at->ahead;
    Py_ssize_t *begin = at->begin, *end = at->end;
    sums[0] = total[0] = 0.0;
    for (Py_ssize_t slot = 0; slot < slots; slot++) {
        const float product = at->common[slot] * weights[slot];
        sums[slot + 1] = sums[slot] + product;
        total[slot + 1] = total[slot] + weights[slot];
    }
    longest(at->common, sums, total, slots, scale, 0, back, begin, at->least);
    longest(at->common, sums, total, slots, scale, 1, ahead, end, NULL);
    for (Py_ssize_t slot = 0; slot < slots; slot++) {
        const double seen = total[slot + 1] - total[begin[slot]];
        const double coming = total[end[slot]] - total[slot];
        const double error = sqrt(1.0 / larger(seen, 1e-9) + 1.0 / larger(coming, 1e-9));
        const double before = back[slot], after = ahead[slot];
        if (seen > 0.0 && coming > 0.0 &&
            fabs(before - after) > SIGMAS * scale * error * 0.5 * (before + after)) {
            if (before >= after)
                end[slot] = slot + 1;
            else
                begin[slot] = slot;
        }
        const double n = total[end[slot]] - total[begin[slot]];
        double own = before;
        if (n > 0.0)
            own = (sums[end[slot]] - sums[begin[slot]]) / larger(n, 1e-9);
        /* Where little lies ahead a stretch takes in too much from before a rise. */
        if (slot >= slots - AHEAD)
            own = larger(own, at->least[slot]);
        back[slot] = larger(own, LEAST);
        level[slot] = (float)back[slot];
        if (slot >= at->past && margin != NULL) {
            const double over = 0.5 * at->steepness * scale * scale / larger(n, 1.0);
            margin[slot - at->past] = (float)(1.0 + smaller(over, MOST_MARGIN));
        }
    }
    if (at->bands < 4)
        return 0;
    /* of_band[slot][band]: what a slot's stretch has in the bands before. */
    for (Py_ssize_t slot = 0; slot < count; slot++)
        at->of_band[slot * (at->bands + 1)] = 0.0;
    for (Py_ssize_t band = 0; band < at->bands; band++) {
        const float *line = at->both + band * slots;
        for (Py_ssize_t slot = 0; slot < slots; slot++) {
            const float product = line[slot] * weights[slot];
            sums[slot + 1] = sums[slot] + product;
        }
        for (Py_ssize_t slot = 0; slot < count; slot++) {
            const Py_ssize_t low = begin[at->past + slot], high = end[at->past + slot];
            const double n = larger(total[high] - total[low], 1e-3);
            const double ratio = (sums[high] - sums[low]) / (n * back[at->past + slot]);
            double *line_sums = at->of_band + slot * (at->bands + 1);
            line_sums[band + 1] = line_sums[band] + larger(ratio, 1e-9);
        }
    }
    int differ = 0;
    for (Py_ssize_t slot = 0; slot < count; slot++) {
        const Py_ssize_t low = begin[at->past + slot], high = end[at->past + slot];
        const double cells = larger(total[high] - total[low], 1e-3) / VARIANCE;
        segments(at->of_band + slot * (at->bands + 1), at->bands, cells, at->circular,
                 at->means, at->split_begin, at->split_end);
        for (Py_ssize_t band = 0; band < at->bands; band++) {
            of_bands[band * count + slot] = (float)at->means[band];
            differ |= (float)at->means[band] != (float)at->means[0];
        }
    }
    return differ;
}

/* level(power, noise, now, usual, stayed, members, past, known, whole, bins, steepness, both,
   weights): fill `both` with the past slots and those of the new columns, `weights` with which
   count; where all are of one level divide by it, in place.
   Returns (level, stayed), or None where levels change. */
static PyObject *level(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t stayed, bands = 0, past = 0, rows = 0, slots = 0;
    PyObject *result = NULL;
    float *work = NULL;
    if (!count_is(given, 13, "level") || get_sizes(args + 4, &stayed, 1) < 0)
        return NULL;
    const double bins = PyFloat_AsDouble(args[9]), steepness = PyFloat_AsDouble(args[10]);
    if (PyErr_Occurred())
        return NULL;
    const float *noise = hold(&held, args[1], 0, 4, 1, &rows, "noise");
    if (noise == NULL)
        goto end;
    float *now = hold(&held, args[2], 1, 4, 1, &bands, "now");
    if (now == NULL)
        goto end;
    float *usual = hold(&held, args[3], 1, 4, bands, NULL, "usual");
    if (usual == NULL)
        goto end;
    const float *members = hold(&held, args[5], 0, 4, bands, NULL, "members");
    if (members == NULL)
        goto end;
    const float *known = hold(&held, args[7], 0, 4, 0, &past, "known");
    if (known == NULL)
        goto end;
    const float *before = hold(&held, args[6], 0, 4, bands * past, NULL, "past");
    if (before == NULL)
        goto end;
    float *weights = hold(&held, args[12], 1, 4, past, &slots, "weights");
    if (weights == NULL)
        goto end;
    float *both = hold(&held, args[11], 1, 4, bands * slots, NULL, "both");
    if (both == NULL)
        goto end;
    const Py_ssize_t count = slots - past;
    Py_buffer *power = &held.view[held.count];
    if (PyObject_GetBuffer(args[0], power, PyBUF_STRIDES | PyBUF_WRITABLE) < 0)
        goto end;
    held.count++;
    if (power->ndim != 2 || power->itemsize != 4 || power->shape[0] != rows ||
        (power->shape[1] > 1 && power->strides[1] != 4) ||
        count != (power->shape[1] + SLOT - 1) / SLOT || count < 1 ||
        rows < (bands - 1) * ROWS_PER_BIN + 1 || !(bins > 0.0)) {
        PyErr_SetString(PyExc_ValueError, "level: no such columns, bands or slots");
        goto end;
    }
    const char *whole = NULL;
    if (args[8] != Py_None) {
        whole = hold(&held, args[8], 0, 1, power->shape[1], NULL, "whole");
        if (whole == NULL)
            goto end;
    }
    work = malloc(sizeof(float) * (slots + bands));
    if (work == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    for (Py_ssize_t band = 0; band < bands; band++)
        memcpy(both + band * slots, before + band * past, sizeof(float) * past);
    memcpy(weights, known, sizeof(float) * past);
    for (Py_ssize_t slot = 0; slot < count; slot++)
        weights[past + slot] = whole == NULL || whole[SLOT * slot] ? 1.0f : 0.0f;
    new_slots(power->buf, power->strides[0], noise, rows, now, bands, both, slots, count);
    double mean, total;
    if (!is_steady(both, weights, members, bands, slots, bins, &mean, &total, work)) {
        result = Py_NewRef(Py_None);
        goto end;
    }
    const double own = mean * (1.0 + 0.5 * steepness * VARIANCE / bins / total);
    const float part = 1.0f / (float)own;
    for (Py_ssize_t row = 0; row < rows; row++) {
        float *line = (float *)((char *)power->buf + row * power->strides[0]);
        for (Py_ssize_t column = 0; column < power->shape[1]; column++)
            line[column] *= part;
    }
    for (Py_ssize_t band = 0; band < bands; band++)
        now[band] = (float)mean;
    result = Py_BuildValue("(dn)", own, average(now, usual, bands, stayed));
end:
    free(work);
    release(&held);
    return result;
}

/* follow(both, weights, members, past, bins, steepness, circular, divisor, bands, told,
   told_bands): levels that change, to search with (`divisor` and `bands` of the slots from
   `past` on) and to measure with. Returns whether the bands differ, for each. */
static PyObject *follow(PyObject *self, PyObject *const *args, Py_ssize_t given)
{
    (void)self;
    buffers_t held = {.count = 0};
    Py_ssize_t past, bands = 0, slots = 0;
    PyObject *result = NULL;
    char *work = NULL;
    if (!count_is(given, 11, "follow") || get_sizes(args + 3, &past, 1) < 0)
        return NULL;
    const double bins = PyFloat_AsDouble(args[4]), steepness = PyFloat_AsDouble(args[5]);
    const int circular = PyObject_IsTrue(args[6]);
    if (PyErr_Occurred())
        return NULL;
    const float *known = hold(&held, args[1], 0, 4, 1, &slots, "weights");
    if (known == NULL)
        goto end;
    const float *members = hold(&held, args[2], 0, 4, 1, &bands, "members");
    if (members == NULL)
        goto end;
    if (past < 0 || past >= slots || !fits(bands, slots) || !(bins > 0.0)) {
        PyErr_SetString(PyExc_ValueError, "follow: no such slots");
        goto end;
    }
    const Py_ssize_t count = slots - past;
    const float *both = hold(&held, args[0], 0, 4, bands * slots, NULL, "both");
    if (both == NULL)
        goto end;
    float *divisor = hold(&held, args[7], 1, 4, count, NULL, "divisor");
    if (divisor == NULL)
        goto end;
    float *of_bands = hold(&held, args[8], 1, 4, bands * count, NULL, "bands");
    if (of_bands == NULL)
        goto end;
    float *told = hold(&held, args[9], 1, 4, slots, NULL, "told");
    if (told == NULL)
        goto end;
    float *told_bands = hold(&held, args[10], 1, 4, bands * count, NULL, "told_bands");
    if (told_bands == NULL)
        goto end;
    const Py_ssize_t doubles = 5 * (slots + 1) + count * (bands + 1) + bands;
    const Py_ssize_t indices = 2 * slots + 2 * bands, floats = 2 * slots + count;
    work = malloc(sizeof(double) * doubles + sizeof(Py_ssize_t) * indices +
                  sizeof(float) * floats + slots);
    if (work == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    double *numbers = (double *)work;
    Py_ssize_t *places = (Py_ssize_t *)(numbers + doubles);
    float *common = (float *)(places + indices), *weights = common + slots;
    float *margin = weights + slots;
    char *doubtful = (char *)(margin + count);
    const levels_t at = {
        .both = both,
        .common = common,
        .bands = bands,
        .slots = slots,
        .past = past,
        .bins = bins,
        .steepness = steepness,
        .circular = circular,
        .sums = numbers,
        .total = numbers + (slots + 1),
        .back = numbers + 2 * (slots + 1),
        .ahead = numbers + 3 * (slots + 1),
        .least = numbers + 4 * (slots + 1),
        .of_band = numbers + 5 * (slots + 1),
        .means = numbers + 5 * (slots + 1) + count * (bands + 1),
        .begin = places,
        .end = places + slots,
        .split_begin = places + 2 * slots,
        .split_end = places + 2 * slots + bands,
    };
    mean_of_bands(both, members, bands, slots, common);
    for (Py_ssize_t slot = 0; slot < slots; slot++)
        common[slot] = common[slot] > (float)LEAST ? common[slot] : (float)LEAST;
    memcpy(weights, known, sizeof(float) * slots);
    const int any = take_out_bursts(common, weights, slots, bins, doubtful);
    const int differ = levels(&at, weights, told, margin, of_bands);
    for (Py_ssize_t slot = 0; slot < count; slot++)
        divisor[slot] = told[past + slot] * margin[slot];
    int told_differ = differ;
    if (any) {
        for (Py_ssize_t slot = 0; slot < slots; slot++)
            if (doubtful[slot])
                weights[slot] = 0.0f;
        told_differ = levels(&at, weights, told, NULL, told_bands);
    } else
        memcpy(told_bands, of_bands, sizeof(float) * bands * count);
    result = Py_BuildValue("(NN)", PyBool_FromLong(differ), PyBool_FromLong(told_differ));
end:
    free(work);
    release(&held);
    return result;
}

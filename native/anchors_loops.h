/* Loops of anchors.h. */

/* Whether any of `count` values reaches `least`. */
INLINE int NAMED(any_reaches)(const float *values, Py_ssize_t count, float least)
{
    int any = 0;
    for (Py_ssize_t i = 0; i < count; i++)
        any |= values[i] >= least;
    return any;
}

/* Cells that reach what their row needs, and none within the reach is larger; how many, and
   -1 without memory. */
static Py_ssize_t NAMED(find_anchors)(const float *cells, Py_ssize_t rows, Py_ssize_t width,
                                      Py_ssize_t length, Py_ssize_t at, Py_ssize_t fresh,
                                      Py_ssize_t reach, const float *levels, float share,
                                      anchor_t **found)
{
    Py_ssize_t count = 0, room = 0;
    anchor_t *list = NULL;
    for (Py_ssize_t row = 0; row < rows; row++) {
        const float least = share * levels[row];
        const float *line = cells + row * width;
        for (Py_ssize_t chunk = 0; chunk < fresh; chunk += 64) {
            const Py_ssize_t end = fresh - chunk < 64 ? fresh : chunk + 64;
            if (!NAMED(any_reaches)(line + at + chunk, end - chunk, least))
                continue;
            for (Py_ssize_t column = chunk; column < end; column++) {
                const float power = line[at + column];
                if (!(power >= least))
                    continue;
                const float *around = line + modulo(at + column - reach, length);
                int peak = 1;
                for (Py_ssize_t i = 0; i <= 2 * reach; i++)
                    peak &= power >= around[i];
                if (!peak)
                    continue;
                if (count == room) {
                    room = room ? 2 * room : 64;
                    anchor_t *more = realloc(list, sizeof(anchor_t) * room);
                    if (more == NULL) {
                        free(list);
                        return -1;
                    }
                    list = more;
                }
                list[count++] = (anchor_t){column, row, around[reach]};
            }
        }
    }
    *found = list;
    return count;
}

/* Largest of 2 reach + 1 neighbours, in place: values[i] of values[i ... i + 2 reach]. */
INLINE Py_ssize_t NAMED(maximise)(float *values, Py_ssize_t count, Py_ssize_t reach)
{
    for (Py_ssize_t covered = 1; covered < 2 * reach + 1;) {
        const Py_ssize_t left = 2 * reach + 1 - covered;
        const Py_ssize_t shift = covered < left ? covered : left;
        count -= shift;
        for (Py_ssize_t i = 0; i < count; i++)
            values[i] = values[i] < values[i + shift] ? values[i + shift] : values[i];
        covered += shift;
    }
    return count;
}

/* Sum over all intervals for one anchor. */
static sum_t NAMED(best_sum)(const float *line, Py_ssize_t length, Py_ssize_t column,
                             float power, float level, float limit, const Py_ssize_t *lows,
                             const Py_ssize_t *rest, Py_ssize_t others, Py_ssize_t intervals,
                             Py_ssize_t stretch, Py_ssize_t reach, float *work)
{
    float *totals = work, *plain = work + intervals, *values = plain + intervals;
    for (Py_ssize_t i = 0; i < intervals; i++)
        totals[i] = plain[i] = 0.0f;
    for (Py_ssize_t other = 0; other < others; other++) {
        memcpy(values, line + modulo(column + lows[other], length), sizeof(float) * stretch);
        NAMED(maximise)(values, stretch, reach);
        const Py_ssize_t *places = rest + other * intervals;
        for (Py_ssize_t i = 0; i < intervals; i++) {
            const float cell = values[places[i]];
            totals[i] += cell < limit ? cell : limit;
            plain[i] += cell;
        }
    }
    const float own = power < limit ? power : limit;
    float best = -INFINITY;
    for (Py_ssize_t i = 0; i < intervals; i++)
        best = totals[i] + own > best ? totals[i] + own : best;
    sum_t result = {best / level, 0.0f, 0};
    for (Py_ssize_t i = 0; i < intervals; i++) {
        const float strength = (plain[i] + power) / level;
        if ((totals[i] + own) / level >= result.best - 0.01f && strength > result.strength) {
            result.strength = strength;
            result.interval = i;
        }
    }
    return result;
}

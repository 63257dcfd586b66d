/* Loops of codes.h: bytes, which the compiler makes vectors of by itself. */

/* The best over the stretches of the sums of `pulses` cells, each at most `clip`. */
static void NAMED(code_sums)(const uint8_t *line, Py_ssize_t length, const int32_t *offsets,
                             Py_ssize_t stretches, Py_ssize_t pulses, uint8_t clip,
                             uint8_t *restrict best, uint8_t *restrict work)
{
    memset(best, 0, length);
    for (Py_ssize_t s = 0; s < stretches; s++) {
        const int32_t *own = offsets + s * pulses;
        if (pulses == 4) {
            const uint8_t *a = line + own[0], *b = line + own[1], *c = line + own[2];
            const uint8_t *d = line + own[3];
            for (Py_ssize_t i = 0; i < length; i++) {
                const uint8_t one = a[i] < clip ? a[i] : clip, two = b[i] < clip ? b[i] : clip;
                const uint8_t three = c[i] < clip ? c[i] : clip;
                const uint8_t four = d[i] < clip ? d[i] : clip;
                const uint8_t sum = (uint8_t)(one + two + three + four);
                best[i] = sum > best[i] ? sum : best[i];
            }
            continue;
        }
        memset(work, 0, length);
        for (Py_ssize_t p = 0; p < pulses; p++) {
            const uint8_t *cells = line + own[p];
            for (Py_ssize_t i = 0; i < length; i++)
                work[i] = (uint8_t)(work[i] + (cells[i] < clip ? cells[i] : clip));
        }
        for (Py_ssize_t i = 0; i < length; i++)
            best[i] = work[i] > best[i] ? work[i] : best[i];
    }
}

/* Add cells, each at most `clip`. */
static void NAMED(code_add)(const uint8_t *cells, Py_ssize_t length, uint8_t clip,
                            uint8_t *restrict sums)
{
    for (Py_ssize_t i = 0; i < length; i++)
        sums[i] = (uint8_t)(sums[i] + (cells[i] < clip ? cells[i] : clip));
}

/* The best window of `bursts` of all 2 * bursts - 1 lines of `work`, over the intervals whose
   places in each line stand in `places`: out is its sum, the interval and the first line. */
static void NAMED(code_windows)(const uint8_t *work, Py_ssize_t room, const int32_t *places,
                                Py_ssize_t intervals, Py_ssize_t bursts, int16_t *restrict sums,
                                int32_t *out)
{
    int16_t *window = sums + (2 * bursts - 1) * intervals;
    memset(window, 0, sizeof(int16_t) * intervals);
    for (Py_ssize_t j = 0; j < 2 * bursts - 1; j++) {
        const uint8_t *line = work + j * room;
        const int32_t *at = places + j * intervals;
        int16_t *own = sums + j * intervals;
        for (Py_ssize_t k = 0; k < intervals; k++)
            own[k] = line[at[k]];
        if (j < bursts)
            for (Py_ssize_t k = 0; k < intervals; k++)
                window[k] = (int16_t)(window[k] + own[k]);
    }
    out[0] = out[1] = out[2] = 0;
    for (Py_ssize_t a = 0; a < bursts; a++) {
        int16_t best = 0;
        for (Py_ssize_t k = 0; k < intervals; k++)
            best = window[k] > best ? window[k] : best;
        if (best > out[0]) {
            out[0] = best;
            out[2] = (int32_t)a;
            for (Py_ssize_t k = intervals; k-- > 0;)
                if (window[k] == best)
                    out[1] = (int32_t)k;
        }
        if (a + 1 == bursts)
            break;
        const int16_t *next = sums + (a + bursts) * intervals, *past = sums + a * intervals;
        for (Py_ssize_t k = 0; k < intervals; k++)
            window[k] = (int16_t)(window[k] + next[k] - past[k]);
    }
}

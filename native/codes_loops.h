/* Loops of codes.h: bytes, which the compiler makes vectors of by itself. */

/* Cells, each at most `clip`. */
static void NAMED(code_clip)(const uint8_t *cells, Py_ssize_t length, uint8_t clip,
                             uint8_t *restrict out)
{
    for (Py_ssize_t i = 0; i < length; i++)
        out[i] = cells[i] < clip ? cells[i] : clip;
}

/* The best over the stretches of the sums of `pulses` cells, for `blocks` times CODE_BLOCK
   columns. */
static void NAMED(code_sums)(const uint8_t *line, Py_ssize_t blocks, const int32_t *offsets,
                             Py_ssize_t stretches, Py_ssize_t pulses, uint8_t *restrict best)
{
    memset(best, 0, blocks * CODE_BLOCK);
    for (Py_ssize_t s = 0; s < stretches; s++) {
        const int32_t *own = offsets + s * pulses;
        for (Py_ssize_t begin = 0; begin < blocks * CODE_BLOCK; begin += CODE_BLOCK) {
            const uint8_t *from = line + begin;
            uint8_t *into = best + begin;
            if (pulses == 4) {
                const uint8_t *a = from + own[0], *b = from + own[1], *c = from + own[2];
                const uint8_t *d = from + own[3];
                for (int i = 0; i < CODE_BLOCK; i++) {
                    const uint8_t sum = (uint8_t)(a[i] + b[i] + c[i] + d[i]);
                    into[i] = sum > into[i] ? sum : into[i];
                }
                continue;
            }
            uint8_t sums[CODE_BLOCK] = {0};
            for (Py_ssize_t p = 0; p < pulses; p++)
                for (int i = 0; i < CODE_BLOCK; i++)
                    sums[i] = (uint8_t)(sums[i] + from[own[p] + i]);
            for (int i = 0; i < CODE_BLOCK; i++)
                into[i] = sums[i] > into[i] ? sums[i] : into[i];
        }
    }
}

/* The largest of CODE_BLOCK sums. */
static uint8_t NAMED(code_highest)(const uint8_t *sums)
{
    uint8_t most = 0;
    for (int i = 0; i < CODE_BLOCK; i++)
        most = sums[i] > most ? sums[i] : most;
    return most;
}

/* Sums of cells, each at most `clip`, of `pulses` lines that begin at `own`. */
static void NAMED(code_add)(const uint8_t *line, Py_ssize_t blocks, const int32_t *own,
                            Py_ssize_t pulses, uint8_t clip, uint8_t *restrict sums)
{
    for (Py_ssize_t begin = 0; begin < blocks * CODE_PART; begin += CODE_PART) {
        uint8_t *into = sums + begin;
        if (pulses == 4) {
            const uint8_t *a = line + begin + own[0], *b = line + begin + own[1];
            const uint8_t *c = line + begin + own[2], *d = line + begin + own[3];
            for (int i = 0; i < CODE_PART; i++) {
                const uint8_t one = a[i] < clip ? a[i] : clip, two = b[i] < clip ? b[i] : clip;
                const uint8_t three = c[i] < clip ? c[i] : clip;
                const uint8_t four = d[i] < clip ? d[i] : clip;
                into[i] = (uint8_t)(one + two + three + four);
            }
            continue;
        }
        memset(into, 0, CODE_PART);
        for (Py_ssize_t p = 0; p < pulses; p++) {
            const uint8_t *cells = line + begin + own[p];
            for (int i = 0; i < CODE_PART; i++)
                into[i] = (uint8_t)(into[i] + (cells[i] < clip ? cells[i] : clip));
        }
    }
}

/* What a line has at the places of CODE_PLACES intervals, which lie in its first 32. */
#if (defined(__AVX2__) || defined(__aarch64__)) && !defined(__clang__)
typedef uint8_t NAMED(code_row) __attribute__((vector_size(16), aligned(1), may_alias));
static void NAMED(code_pick)(const uint8_t *line, const uint8_t *places, uint8_t *restrict out)
{
    const NAMED(code_row) low = *(const NAMED(code_row) *)line;
    const NAMED(code_row) high = *(const NAMED(code_row) *)(line + 16);
    *(NAMED(code_row) *)out =
        __builtin_shuffle(low, high, *(const NAMED(code_row) *)places);
}
#else
static void NAMED(code_pick)(const uint8_t *line, const uint8_t *places, uint8_t *restrict out)
{
    for (int i = 0; i < CODE_PLACES; i++)
        out[i] = line[places[i]];
}
#endif

/* The best window of `bursts` of all 2 * bursts - 1 lines of `work`, over the intervals. Those
   of each line and CODE_PLACES intervals have their places in `places`, from `starts` on; the
   rest of the last repeat the last interval. out is its sum, the interval and the first line. */
static void NAMED(code_windows)(const uint8_t *work, Py_ssize_t room, const int32_t *starts,
                                const uint8_t *places, Py_ssize_t parts, Py_ssize_t bursts,
                                uint8_t *restrict picked, int16_t *restrict window, int32_t *out)
{
    const Py_ssize_t width = parts * CODE_PLACES;
    for (Py_ssize_t j = 0; j < 2 * bursts - 1; j++)
        for (Py_ssize_t part = 0; part < parts; part++) {
            const Py_ssize_t at = j * parts + part;
            NAMED(code_pick)(work + j * room + starts[at], places + at * CODE_PLACES,
                             picked + at * CODE_PLACES);
        }
    out[0] = out[1] = out[2] = 0;
    memset(window, 0, sizeof(int16_t) * width);
    for (Py_ssize_t j = 0; j < bursts; j++)
        for (Py_ssize_t k = 0; k < width; k++)
            window[k] = (int16_t)(window[k] + picked[j * width + k]);
    for (Py_ssize_t a = 0; a < bursts; a++) {
        int16_t best = 0;
        for (Py_ssize_t k = 0; k < width; k++)
            best = window[k] > best ? window[k] : best;
        if (best > out[0]) {
            out[0] = best;
            out[2] = (int32_t)a;
        }
        if (a + 1 == bursts)
            break;
        const uint8_t *next = picked + (a + bursts) * width, *past = picked + a * width;
        for (Py_ssize_t k = 0; k < width; k++)
            window[k] = (int16_t)(window[k] + next[k] - past[k]);
    }
    /* The first of the intervals with that sum. */
    memset(window, 0, sizeof(int16_t) * width);
    for (Py_ssize_t j = out[2]; j < out[2] + bursts; j++)
        for (Py_ssize_t k = 0; k < width; k++)
            window[k] = (int16_t)(window[k] + picked[j * width + k]);
    while (out[0] > 0 && window[out[1]] != out[0])
        out[1]++;
}

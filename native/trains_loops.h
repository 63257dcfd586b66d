/* Loops of trains.h. */

/* Sums of 2^level periods from `start` on, at the intervals `low` to `high`. Halves are made
   first and added at once, while they are near: each level in the other of two parts. */
static void NAMED(train_block)(const train_t *train, Py_ssize_t start, int level,
                               Py_ssize_t low, Py_ssize_t high)
{
    const Py_ssize_t period = train->period, stride = train->stride;
    float *out = train->part[level & 1] + start * stride;
    if (level == 0) {
        const Py_ssize_t left = train->slots - start * period;
        const Py_ssize_t there = left < period ? left : period;
        memcpy(out, train->values + start * period, sizeof(float) * there);
        memset(out + there, 0, sizeof(float) * (period - there));
        return;
    }
    const Py_ssize_t half = (Py_ssize_t)1 << (level - 1), middle = start + half;
    const int more = middle * period < train->slots;
    NAMED(train_block)(train, start, level - 1, low >> 1, high >> 1);
    if (more)
        NAMED(train_block)(train, middle, level - 1, low >> 1, high >> 1);
    const float *early = train->part[(level - 1) & 1] + start * stride;
    const float *late = early + half * stride;
    for (Py_ssize_t d = low; d <= high; d++) {
        float *to = out + d * stride;
        const float *one = early + (d >> 1) * stride;
        if (!more) {
            memcpy(to, one, sizeof(float) * period);
            continue;
        }
        /* What a vector writes beyond `kept` is written again, and beyond a row never read. */
        const Py_ssize_t shift = ((d + 1) >> 1) % period, kept = period - shift;
        const float *two = late + (d >> 1) * stride + shift;
        for (Py_ssize_t p = 0; p < kept; p += LANES)
            STORE(to + p, LOAD(one + p) + LOAD(two + p));
        two -= period;
        for (Py_ssize_t p = kept; p < period; p += LANES)
            STORE(to + p, LOAD(one + p) + LOAD(two + p));
    }
}

typedef int32_t NAMED(tiles) __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
#define tiles_t NAMED(tiles)
#define LARGER(a, b) \
    ((lanes_t)(((tiles_t)(a) & ((a) > (b))) | ((tiles_t)(b) & ~((a) > (b)))))
#define VECTORS (LANES > 8 ? 4 : 2)
#define TILE (VECTORS * LANES)

/* Cells `first` and on of all patterns, each row times its scale; the last stands for those
   beyond. */
static void NAMED(train_tile)(const mix_t *mix, Py_ssize_t first, float *tile)
{
    const Py_ssize_t cells = mix->rows * mix->period;
    float scale[TILE];
    Py_ssize_t row = first / mix->period, phase = first % mix->period;
    const Py_ssize_t count = cells - first < TILE ? cells - first : TILE;
    for (Py_ssize_t i = 0; i < count; i++) {
        scale[i] = mix->scale[row];
        if (++phase == mix->period) {
            phase = 0;
            row++;
        }
    }
    for (Py_ssize_t k = 0; k < mix->patterns; k++) {
        const float *from = mix->sums + k * cells + first;
        float *to = tile + k * TILE;
        for (Py_ssize_t i = 0; i < count; i++)
            to[i] = from[i] * scale[i];
        for (Py_ssize_t i = count; i < TILE; i++)
            to[i] = to[count - 1];
    }
}

/* Of each place the highest mixed sum and its cell. */
static void NAMED(train_highest)(const mix_t *mix, float *best, int32_t *cell)
{
    const Py_ssize_t patterns = mix->patterns, places = mix->places;
    const Py_ssize_t groups = (places + PLACES - 1) / PLACES, cells = mix->rows * mix->period;
    float *tile = mix->tile, *top = mix->top;
    int32_t *top_at = (int32_t *)(top + groups * PLACES * LANES);
    for (Py_ssize_t x = 0; x < groups * PLACES; x++) {
        for (int lane = 0; lane < LANES; lane++) {
            top[x * LANES + lane] = -INFINITY;
            top_at[x * LANES + lane] = 0;
        }
        for (Py_ssize_t k = 0; k < patterns; k++)
            mix->mixed[(x / PLACES * patterns + k) * PLACES + x % PLACES] =
                x < places ? mix->mixing[x * patterns + k] : 0.0f;
    }
    for (Py_ssize_t first = 0; first < cells; first += TILE) {
        NAMED(train_tile)(mix, first, tile);
        for (Py_ssize_t group = 0; group < groups; group++) {
            const float *weight = mix->mixed + group * patterns * PLACES;
            lanes_t sum[PLACES][VECTORS];
            for (int x = 0; x < PLACES; x++)
                for (int v = 0; v < VECTORS; v++)
                    sum[x][v] = (lanes_t){0};
            for (Py_ssize_t k = 0; k < patterns; k++) {
                lanes_t value[VECTORS];
                for (int v = 0; v < VECTORS; v++)
                    value[v] = LOAD(tile + k * TILE + v * LANES);
                for (int x = 0; x < PLACES; x++)
                    for (int v = 0; v < VECTORS; v++)
                        sum[x][v] += value[v] * weight[k * PLACES + x];
            }
            for (int x = 0; x < PLACES; x++) {
                lanes_t most = sum[x][0];
                for (int v = 1; v < VECTORS; v++)
                    most = LARGER(most, sum[x][v]);
                float *at = top + (group * PLACES + x) * LANES;
                tiles_t *number = (tiles_t *)(top_at + (group * PLACES + x) * LANES);
                const lanes_t before = LOAD(at);
                const tiles_t higher = most > before;
                const tiles_t here = (tiles_t){0} + (int32_t)(first / TILE);
                *number = (here & higher) | (*number & ~higher);
                STORE(at, LARGER(most, before));
            }
        }
    }
    for (Py_ssize_t x = 0; x < places; x++) {
        int lane = 0;
        for (int i = 1; i < LANES; i++)
            lane = top[x * LANES + i] > top[x * LANES + lane] ? i : lane;
        best[x] = top[x * LANES + lane];
        /* Which of the tile's vectors it was. */
        float most = -INFINITY;
        cell[x] = 0;
        for (int v = 0; v < VECTORS; v++) {
            Py_ssize_t at = (Py_ssize_t)top_at[x * LANES + lane] * TILE + v * LANES + lane;
            at = at < cells ? at : cells - 1;
            float sum = 0.0f;
            for (Py_ssize_t k = 0; k < patterns; k++)
                sum += mix->mixing[x * patterns + k] * mix->sums[k * cells + at];
            sum *= mix->scale[at / mix->period];
            if (sum > most) {
                most = sum;
                cell[x] = (int32_t)at;
            }
        }
    }
}

#undef tiles_t
#undef LARGER
#undef VECTORS
#undef TILE

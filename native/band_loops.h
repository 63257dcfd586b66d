/* Loops of band.h. */

/* `pairs` times two outputs of the narrow band from `x` on, before they are turned: of each
   the sums of re × re, re × im, im × re, im × im. */
INLINE void NAMED(band_sums)(const float *x, const float *taps, Py_ssize_t length,
                             Py_ssize_t step, int pairs, float *sums)
{
    const float *other = taps + length;
    lanes_t a[4], b[4];
    for (int one = 0; one < 2 * pairs; one++)
        a[one] = b[one] = (lanes_t){0};
    for (Py_ssize_t k = 0; k < length; k += LANES) {
        const lanes_t re = LOAD(taps + k), im = LOAD(other + k);
        for (int one = 0; one < 2 * pairs; one++) {
            const lanes_t sample = LOAD(x + one * step + k);
            a[one] += re * sample;
            b[one] += im * sample;
        }
    }
    for (int one = 0; one < 2 * pairs; one++) {
        NAMED(halves)(a[one], sums + 4 * one, sums + 4 * one + 1);
        NAMED(halves)(b[one], sums + 4 * one + 2, sums + 4 * one + 3);
    }
}

/* out[n] = turns[n] sum of taps[k] samples[factor n + k]; taps as two rows of
   `length` floats, a multiple of 16 and zeros at the end: the real parts twice each, then the
   imaginary ones. turns[n] is the product
   of a row's and of a place's within the row of eight. */
static void NAMED(band_outputs)(const float *samples, Py_ssize_t floats, const float *taps,
                                Py_ssize_t length, Py_ssize_t factor, Py_ssize_t count,
                                const float *rows, const float *places, Py_ssize_t in_row,
                                float *out)
{
    const Py_ssize_t step = 2 * factor;
    const float *other = taps + length;
    for (Py_ssize_t n = 0; n < count; n += 4) {
        const float *x = samples + n * step;
        const int some = count - n < 4 ? (int)(count - n) : 4;
        float sums[16] = {0};
        if (some == 4 && (n + 3) * step + length <= floats) {
            NAMED(band_sums)(x, taps, length, step, 2, sums);
        } else {
            /* The taps end with zeros: no sample is missing for them. */
            for (int one = 0; one < some; one++) {
                const float *z = x + one * step;
                const Py_ssize_t end = floats - (z - samples);
                for (Py_ssize_t k = 0; k < length && k < end; k += 2) {
                    sums[4 * one] += taps[k] * z[k];
                    sums[4 * one + 1] += taps[k] * z[k + 1];
                    sums[4 * one + 2] += other[k] * z[k];
                    sums[4 * one + 3] += other[k] * z[k + 1];
                }
            }
        }
        for (int one = 0; one < some; one++) {
            const float *s = sums + 4 * one;
            const float re = s[0] - s[3], im = s[1] + s[2];
            const float *row = rows + 2 * ((n + one) / in_row);
            const float *place = places + 2 * ((n + one) % in_row);
            const float tr = row[0] * place[0] - row[1] * place[1];
            const float ti = row[0] * place[1] + row[1] * place[0];
            out[2 * (n + one)] = re * tr - im * ti;
            out[2 * (n + one) + 1] = re * ti + im * tr;
        }
    }
}

/* Power of a row's cells below the middle and above it, from A and B of the transform. */
INLINE void NAMED(put_powers)(lanes_t a0, lanes_t a1, lanes_t b0, lanes_t b1, float *low,
                              float *high, Py_ssize_t count)
{
    lanes_t one = a0 - b1, two = a1 + b0;
    const lanes_t below = one * one + two * two;
    one = a0 + b1;
    two = a1 - b0;
    const lanes_t above = one * one + two * two;
    if (count == LANES) {
        STORE(low, below);
        STORE(high, above);
    } else {
        memcpy(low, &below, sizeof(float) * count);
        memcpy(high, &above, sizeof(float) * count);
    }
}

/* Power of every cell: power[row][column]. With e(n) = x(n) + x(-n) and o(n) = x(n) - x(-n)
   around a window's middle the transform at +-f is A -+ jB, A the sum of e cos, B of o sin. */
static void NAMED(cell_powers)(const float *samples, Py_ssize_t hop, Py_ssize_t length,
                               Py_ssize_t columns, const float *cosines, const float *sines,
                               Py_ssize_t middle, Py_ssize_t stride, float *power, float *work,
                               Py_ssize_t room)
{
    const Py_ssize_t half = length / 2, evens = length - half;
    /* Samples of one place of the hop side by side: then those of a vector's columns are. */
    float *parts = work;
    const Py_ssize_t total = (columns - 1) * hop + length;
    for (Py_ssize_t phase = 0; phase < hop; phase++) {
        float *re = parts + 2 * phase * room, *im = re + room;
        const Py_ssize_t own = (total - phase + hop - 1) / hop;
        for (Py_ssize_t n = 0; n < own; n++) {
            re[n] = samples[2 * (phase + n * hop)];
            im[n] = samples[2 * (phase + n * hop) + 1];
        }
        memset(re + own, 0, sizeof(float) * (room - own));
        memset(im + own, 0, sizeof(float) * (room - own));
    }
    lanes_t even[2][MOST_WINDOW], odd[2][MOST_WINDOW];
    for (Py_ssize_t first = 0; first < columns; first += LANES) {
        for (int part = 0; part < 2; part++) {
            const float *base = parts + part * room + first;
            for (Py_ssize_t n = 0; n < half; n++) {
                const Py_ssize_t late = length - half + n, early = half - 1 - n;
                const lanes_t a = LOAD(base + 2 * (late % hop) * room + late / hop);
                const lanes_t b = LOAD(base + 2 * (early % hop) * room + early / hop);
                even[part][n] = a + b;
                odd[part][n] = a - b;
            }
            if (evens > half)
                even[part][half] = LOAD(base + 2 * (half % hop) * room + half / hop);
        }
        const Py_ssize_t count = columns - first < LANES ? columns - first : LANES;
        /* Two rows at once: eight sums that do not wait for each other. */
        for (Py_ssize_t row = 0; row <= middle; row += 2) {
            const Py_ssize_t next = row < middle ? row + 1 : row;
            const float *c = cosines + row * evens, *s = sines + row * half;
            const float *d = cosines + next * evens, *t = sines + next * half;
            lanes_t a0 = {0}, a1 = {0}, b0 = {0}, b1 = {0};
            lanes_t c0 = {0}, c1 = {0}, d0 = {0}, d1 = {0};
            for (Py_ssize_t n = 0; n < half; n++) {
                a0 += c[n] * even[0][n];
                a1 += c[n] * even[1][n];
                b0 += s[n] * odd[0][n];
                b1 += s[n] * odd[1][n];
                c0 += d[n] * even[0][n];
                c1 += d[n] * even[1][n];
                d0 += t[n] * odd[0][n];
                d1 += t[n] * odd[1][n];
            }
            if (evens > half) {
                a0 += c[half] * even[0][half];
                a1 += c[half] * even[1][half];
                c0 += d[half] * even[0][half];
                c1 += d[half] * even[1][half];
            }
            float *here = power + first;
            NAMED(put_powers)(a0, a1, b0, b1, here + (middle - row) * stride,
                              here + (middle + row) * stride, count);
            NAMED(put_powers)(c0, c1, d0, d1, here + (middle - next) * stride,
                              here + (middle + next) * stride, count);
        }
    }
}

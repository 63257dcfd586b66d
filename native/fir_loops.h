/* Loops of fir.h. */

/* Sum of the even and of the odd lanes. */
INLINE void NAMED(halves)(lanes_t sum, float *even, float *odd)
{
    float part[LANES];
    memcpy(part, &sum, sizeof part);
    four_t both = LOAD4(part);
    for (int lane = 4; lane < LANES; lane += 4)
        both += LOAD4(part + lane);
    *even = both[0] + both[2];
    *odd = both[1] + both[3];
}

/* out[n] = sum of taps[k] samples[factor n + k], with real taps that stand there twice,
   `length` floats of them. */
static void NAMED(decimate_outputs)(const float *samples, const float *taps, Py_ssize_t length,
                                    Py_ssize_t factor, Py_ssize_t count, float *out)
{
    const Py_ssize_t step = 2 * factor, whole = length / (2 * LANES) * (2 * LANES);
    Py_ssize_t n = 0;
    for (; n + 4 <= count; n += 4) {
        const float *x = samples + n * step;
        /* Eight sums at once: a product takes four cycles, and two can begin in each. */
        lanes_t a = {0}, b = {0}, c = {0}, d = {0}, e = {0}, f = {0}, g = {0}, h = {0};
        for (Py_ssize_t k = 0; k < whole; k += 2 * LANES) {
            const lanes_t one = LOAD(taps + k), two = LOAD(taps + k + LANES);
            a += one * LOAD(x + k);
            b += one * LOAD(x + step + k);
            c += one * LOAD(x + 2 * step + k);
            d += one * LOAD(x + 3 * step + k);
            e += two * LOAD(x + k + LANES);
            f += two * LOAD(x + step + k + LANES);
            g += two * LOAD(x + 2 * step + k + LANES);
            h += two * LOAD(x + 3 * step + k + LANES);
        }
        float sums[8];
        NAMED(halves)(a + e, sums, sums + 1);
        NAMED(halves)(b + f, sums + 2, sums + 3);
        NAMED(halves)(c + g, sums + 4, sums + 5);
        NAMED(halves)(d + h, sums + 6, sums + 7);
        for (Py_ssize_t k = whole; k < length; k += 2) {
            for (int one = 0; one < 4; one++) {
                sums[2 * one] += taps[k] * x[one * step + k];
                sums[2 * one + 1] += taps[k] * x[one * step + k + 1];
            }
        }
        memcpy(out + 2 * n, sums, sizeof sums);
    }
    for (; n < count; n++) {
        float re = 0.0f, im = 0.0f;
        for (Py_ssize_t k = 0; k < length; k += 2) {
            re += taps[k] * samples[n * step + k];
            im += taps[k] * samples[n * step + k + 1];
        }
        out[2 * n] = re;
        out[2 * n + 1] = im;
    }
}

/* Largest magnitude of a real or imaginary part. */
static float NAMED(largest_part)(const float *values, Py_ssize_t count)
{
    enum { WIDTH = 4 * LANES };
    float most[WIDTH] = {0}, largest = 0.0f;
    Py_ssize_t i = 0;
    for (; i + WIDTH <= count; i += WIDTH)
        for (int k = 0; k < WIDTH; k++) {
            const float value = fabsf(values[i + k]);
            most[k] = value > most[k] ? value : most[k];
        }
    for (int k = 0; k < WIDTH; k++)
        largest = most[k] > largest ? most[k] : largest;
    for (; i < count; i++)
        largest = fabsf(values[i]) > largest ? fabsf(values[i]) : largest;
    return largest;
}

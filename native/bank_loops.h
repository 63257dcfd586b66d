/* Loops of bank.h: as many outputs at a time as a vector has lanes, each lane one of them, so
   that the transform needs no shuffles. It is Stockham's, of radices 2, 3, 4, 5, and any other
   by its definition. */

/* Windows of `count` outputs, weighted and added up modulo M: folded[lane][2 M]. */
INLINE void NAMED(fold)(const float *samples, const float *weights, float *folded,
                        Py_ssize_t width, Py_ssize_t phases, Py_ssize_t step, int count)
{
    for (int row = 0; row < count; row += 4) {
        const float *base = samples + row * step;
        float *out = folded + row * width;
        int rows = count - row < 4 ? count - row : 4;
        Py_ssize_t i = 0;
        if (rows == 4) {
            for (; i + LANES <= width; i += LANES) {
                lanes_t a = {0}, b = {0}, c = {0}, d = {0};
                const float *x = base + i, *w = weights + i;
                for (Py_ssize_t q = 0; q < phases; q++, x += width, w += width) {
                    lanes_t weight = LOAD(w);
                    a += weight * LOAD(x);
                    b += weight * LOAD(x + step);
                    c += weight * LOAD(x + 2 * step);
                    d += weight * LOAD(x + 3 * step);
                }
                STORE(out + i, a);
                STORE(out + width + i, b);
                STORE(out + 2 * width + i, c);
                STORE(out + 3 * width + i, d);
            }
        }
        for (int one = 0; one < rows; one++) {
            Py_ssize_t j = i;
            for (; j + 4 <= width; j += 4) {
                four_t sum = {0};
                for (Py_ssize_t q = 0; q < phases; q++)
                    sum += LOAD4(weights + q * width + j) *
                           LOAD4(base + one * step + q * width + j);
                STORE4(out + one * width + j, sum);
            }
            for (; j < width; j++) {
                float sum = 0.0f;
                for (Py_ssize_t q = 0; q < phases; q++)
                    sum += weights[q * width + j] * base[one * step + q * width + j];
                out[one * width + j] = sum;
            }
        }
    }
}

/* folded[lane][2 M] to turned[2 M][lane]. */
INLINE void NAMED(turn_over)(const float *folded, float *turned, Py_ssize_t width)
{
    for (Py_ssize_t i = 0; i + 4 <= width; i += 4) {
        for (int lane = 0; lane < LANES; lane += 4) {
            four_t a = LOAD4(folded + lane * width + i);
            four_t b = LOAD4(folded + (lane + 1) * width + i);
            four_t c = LOAD4(folded + (lane + 2) * width + i);
            four_t d = LOAD4(folded + (lane + 3) * width + i);
            four_t ab0 = SHUFFLE4(a, b, 0, 4, 1, 5), ab1 = SHUFFLE4(a, b, 2, 6, 3, 7);
            four_t cd0 = SHUFFLE4(c, d, 0, 4, 1, 5), cd1 = SHUFFLE4(c, d, 2, 6, 3, 7);
            float *out = turned + i * LANES + lane;
            STORE4(out, SHUFFLE4(ab0, cd0, 0, 1, 4, 5));
            STORE4(out + LANES, SHUFFLE4(ab0, cd0, 2, 3, 6, 7));
            STORE4(out + 2 * LANES, SHUFFLE4(ab1, cd1, 0, 1, 4, 5));
            STORE4(out + 3 * LANES, SHUFFLE4(ab1, cd1, 2, 3, 6, 7));
        }
    }
    for (Py_ssize_t i = width / 4 * 4; i < width; i++)
        for (int lane = 0; lane < LANES; lane++)
            turned[i * LANES + lane] = folded[lane * width + i];
}

/* Store (re + j im) times twiddle `w`. */
INLINE void NAMED(put)(float *to, lanes_t re, lanes_t im, const float *w)
{
    STORE(to, re * w[0] - im * w[1]);
    STORE(to + LANES, re * w[1] + im * w[0]);
}

/* One pass of Stockham's transform: `left` points still to be transformed, `done` are. */
INLINE void NAMED(pass)(const float *from, float *to, const float *twiddles, Py_ssize_t size,
                        Py_ssize_t left, Py_ssize_t done, int radix)
{
    const Py_ssize_t part = left / radix, apart = 2 * LANES * done * part;
    for (Py_ssize_t p = 0; p < part; p++) {
        for (Py_ssize_t q = 0; q < done; q++) {
            const float *x = from + 2 * LANES * (q + done * p);
            float *y = to + 2 * LANES * (q + done * radix * p);
            const Py_ssize_t next = 2 * LANES * done;
            const float *w1 = twiddles + 2 * done * p;
            if (radix == 2) {
                lanes_t ar = LOAD(x), ai = LOAD(x + LANES);
                lanes_t br = LOAD(x + apart), bi = LOAD(x + apart + LANES);
                STORE(y, ar + br);
                STORE(y + LANES, ai + bi);
                NAMED(put)(y + next, ar - br, ai - bi, w1);
            } else if (radix == 4) {
                const float *x2 = x + 2 * apart;
                lanes_t ar = LOAD(x), ai = LOAD(x + LANES);
                lanes_t br = LOAD(x + apart), bi = LOAD(x + apart + LANES);
                lanes_t cr = LOAD(x2), ci = LOAD(x2 + LANES);
                lanes_t dr = LOAD(x2 + apart), di = LOAD(x2 + apart + LANES);
                lanes_t acr = ar + cr, aci = ai + ci, amr = ar - cr, ami = ai - ci;
                lanes_t bdr = br + dr, bdi = bi + di, bmr = br - dr, bmi = bi - di;
                STORE(y, acr + bdr);
                STORE(y + LANES, aci + bdi);
                NAMED(put)(y + next, amr + bmi, ami - bmr, w1);
                NAMED(put)(y + 2 * next, acr - bdr, aci - bdi, twiddles + 4 * done * p);
                NAMED(put)(y + 3 * next, amr - bmi, ami + bmr, twiddles + 6 * done * p);
            } else if (radix == 3) {
                lanes_t ar = LOAD(x), ai = LOAD(x + LANES);
                lanes_t br = LOAD(x + apart), bi = LOAD(x + apart + LANES);
                lanes_t cr = LOAD(x + 2 * apart), ci = LOAD(x + 2 * apart + LANES);
                lanes_t sr = br + cr, si = bi + ci;
                lanes_t mr = (br - cr) * 0.86602540378443865f;
                lanes_t mi = (bi - ci) * 0.86602540378443865f;
                lanes_t tr = ar - sr * 0.5f, ti = ai - si * 0.5f;
                STORE(y, ar + sr);
                STORE(y + LANES, ai + si);
                NAMED(put)(y + next, tr + mi, ti - mr, w1);
                NAMED(put)(y + 2 * next, tr - mi, ti + mr, twiddles + 4 * done * p);
            } else if (radix == 5) {
                const float c1 = 0.30901699437494742f, c2 = -0.80901699437494742f;
                const float s1 = 0.95105651629515357f, s2 = 0.58778525229247313f;
                const float *x3 = x + 3 * apart;
                lanes_t ar = LOAD(x), ai = LOAD(x + LANES);
                lanes_t br = LOAD(x + apart), bi = LOAD(x + apart + LANES);
                lanes_t cr = LOAD(x + 2 * apart), ci = LOAD(x + 2 * apart + LANES);
                lanes_t dr = LOAD(x3), di = LOAD(x3 + LANES);
                lanes_t er = LOAD(x3 + apart), ei = LOAD(x3 + apart + LANES);
                lanes_t ber = br + er, bei = bi + ei, bmr = br - er, bmi = bi - ei;
                lanes_t cdr = cr + dr, cdi = ci + di, cmr = cr - dr, cmi = ci - di;
                lanes_t pr = ar + ber * c1 + cdr * c2, pi = ai + bei * c1 + cdi * c2;
                lanes_t qr = ar + ber * c2 + cdr * c1, qi = ai + bei * c2 + cdi * c1;
                lanes_t ur = bmr * s1 + cmr * s2, ui = bmi * s1 + cmi * s2;
                lanes_t vr = bmr * s2 - cmr * s1, vi = bmi * s2 - cmi * s1;
                STORE(y, ar + ber + cdr);
                STORE(y + LANES, ai + bei + cdi);
                NAMED(put)(y + next, pr + ui, pi - ur, w1);
                NAMED(put)(y + 2 * next, qr + vi, qi - vr, twiddles + 4 * done * p);
                NAMED(put)(y + 3 * next, qr - vi, qi + vr, twiddles + 6 * done * p);
                NAMED(put)(y + 4 * next, pr - ui, pi + ur, twiddles + 8 * done * p);
            } else {
                for (int j = 0; j < radix; j++) {
                    lanes_t re = {0}, im = {0};
                    for (int k = 0; k < radix; k++) {
                        const float *w = twiddles + 2 * (size / radix * (j * k % radix));
                        lanes_t a = LOAD(x + k * apart), b = LOAD(x + k * apart + LANES);
                        re += a * w[0] - b * w[1];
                        im += a * w[1] + b * w[0];
                    }
                    NAMED(put)(y + j * next, re, im, twiddles + 2 * done * p * j);
                }
            }
        }
    }
}

/* Outputs of all channels chosen; `work` holds 6 M floats for each lane. */
static void NAMED(bank_outputs)(const float *samples, const float *weights,
                                const float *twiddles, const int32_t *chosen,
                                Py_ssize_t channels, Py_ssize_t phases, Py_ssize_t hop,
                                Py_ssize_t rows, Py_ssize_t choices, int odd, float *out,
                                Py_ssize_t out_rows, float *work)
{
    const Py_ssize_t width = 2 * channels;
    float *folded = work, *one = work + LANES * width, *two = one + LANES * width;
    int factors[64], passes = 0;
    Py_ssize_t rest = channels;
    for (; rest % 4 == 0; rest /= 4)
        factors[passes++] = 4;
    for (int radix = 2; rest > 1; radix++)
        for (; rest % radix == 0; rest /= radix)
            factors[passes++] = radix;
    for (Py_ssize_t row = 0; row < rows; row += LANES) {
        int count = rows - row < LANES ? (int)(rows - row) : LANES;
        if (count < LANES)
            memset(folded, 0, sizeof(float) * LANES * width);
        NAMED(fold)(samples + 2 * hop * row, weights, folded, width, phases, 2 * hop, count);
        NAMED(turn_over)(folded, one, width);
        float *from = one, *to = two;
        Py_ssize_t left = channels, done = 1;
        for (int at = 0; at < passes; at++) {
            int radix = factors[at];
            switch (radix) {
            case 2: NAMED(pass)(from, to, twiddles, channels, left, done, 2); break;
            case 3: NAMED(pass)(from, to, twiddles, channels, left, done, 3); break;
            case 4: NAMED(pass)(from, to, twiddles, channels, left, done, 4); break;
            case 5: NAMED(pass)(from, to, twiddles, channels, left, done, 5); break;
            default: NAMED(pass)(from, to, twiddles, channels, left, done, radix);
            }
            left /= radix;
            done *= radix;
            float *swap = from;
            from = to;
            to = swap;
        }
        for (Py_ssize_t at = 0; at < choices; at++) {
            const float *value = from + 2 * LANES * chosen[at];
            float *target = out + 2 * (at * out_rows + row);
            /* Half a turn of the window: odd outputs of odd channels change their sign. */
            float even = 1.0f, other = 1.0f;
            if (hop != channels && chosen[at] % 2) {
                even = (odd + row) % 2 ? -1.0f : 1.0f;
                other = -even;
            }
            for (int lane = 0; lane < count; lane++) {
                float sign = lane % 2 ? other : even;
                target[2 * lane] = sign * value[lane];
                target[2 * lane + 1] = sign * value[LANES + lane];
            }
        }
    }
}

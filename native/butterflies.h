/* One step of a transform with vectors of one width: included by beeps_loops.h for each. */
INLINE void NAMED(JOIN(BUTTERFLIES, of))(int radix, const float *x, float *y,
                                                 Py_ssize_t size, Py_ssize_t parts,
                                                 const float *twiddles, Py_ssize_t stride)
{
    const Py_ssize_t width = 4 * stride, far = parts * width;
    for (Py_ssize_t p = 0; p < parts; p++) {
        float wr[5], wi[5];
        for (int i = 0; i < radix; i++) {
            wr[i] = twiddles[2 * i * p * stride];
            wi[i] = twiddles[2 * i * p * stride + 1];
        }
        const float *ar = x + p * width, *ai = ar + 4 * size;
        float *br = y + radix * p * width, *bi = br + 4 * size;
        for (Py_ssize_t q = 0; q < width; q += WIDTH) {
            GET(0);
            GET(1);
            if (radix == 2) {
                PUT(0, r0 + r1, s0 + s1);
                PUT(1, r0 - r1, s0 - s1);
                continue;
            }
            GET(2);
            if (radix == 3) {
                const vector_t mr = r0 - 0.5f * (r1 + r2), ms = s0 - 0.5f * (s1 + s2);
                const vector_t dr = 0.8660254038f * (r1 - r2), ds = 0.8660254038f * (s1 - s2);
                PUT(0, r0 + (r1 + r2), s0 + (s1 + s2));
                PUT(1, mr + ds, ms - dr);
                PUT(2, mr - ds, ms + dr);
                continue;
            }
            GET(3);
            if (radix == 4) {
                const vector_t er = r0 + r2, es = s0 + s2, fr = r1 + r3, fs = s1 + s3;
                const vector_t gr = r0 - r2, gs = s0 - s2, hr = r1 - r3, hs = s1 - s3;
                PUT(0, er + fr, es + fs);
                PUT(1, gr + hs, gs - hr);
                PUT(2, er - fr, es - fs);
                PUT(3, gr - hs, gs + hr);
                continue;
            }
            GET(4);
            const vector_t er = r1 + r4, es = s1 + s4, fr = r2 + r3, fs = s2 + s3;
            const vector_t gr = r1 - r4, gs = s1 - s4, hr = r2 - r3, hs = s2 - s3;
            const vector_t mr = r0 + 0.3090169944f * er - 0.8090169944f * fr;
            const vector_t ms = s0 + 0.3090169944f * es - 0.8090169944f * fs;
            const vector_t nr = r0 - 0.8090169944f * er + 0.3090169944f * fr;
            const vector_t ns = s0 - 0.8090169944f * es + 0.3090169944f * fs;
            const vector_t ur = 0.9510565163f * gr + 0.5877852523f * hr;
            const vector_t us = 0.9510565163f * gs + 0.5877852523f * hs;
            const vector_t vr = 0.5877852523f * gr - 0.9510565163f * hr;
            const vector_t vs = 0.5877852523f * gs - 0.9510565163f * hs;
            PUT(0, r0 + er + fr, s0 + es + fs);
            PUT(1, mr + us, ms - ur);
            PUT(2, nr + vs, ns - vr);
            PUT(3, nr - vs, ns + vr);
            PUT(4, mr - us, ms + ur);
        }
    }
}

static void NAMED(BUTTERFLIES)(int radix, const float *x, float *y, Py_ssize_t size,
                               Py_ssize_t parts, const float *twiddles, Py_ssize_t stride)
{
    /* As constants: the compiler makes code of each radix. */
    if (radix == 2)
        NAMED(JOIN(BUTTERFLIES, of))(2, x, y, size, parts, twiddles, stride);
    else if (radix == 3)
        NAMED(JOIN(BUTTERFLIES, of))(3, x, y, size, parts, twiddles, stride);
    else if (radix == 4)
        NAMED(JOIN(BUTTERFLIES, of))(4, x, y, size, parts, twiddles, stride);
    else
        NAMED(JOIN(BUTTERFLIES, of))(5, x, y, size, parts, twiddles, stride);
}

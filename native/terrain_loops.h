/* Loops of terrain.h. */

typedef int32_t NAMED(whole) __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
#define whole_t NAMED(whole)
#define LARGER(a, b) \
    ((lanes_t)(((whole_t)(a) & ((a) > (b))) | ((whole_t)(b) & ~((a) > (b)))))

/* Largest slopes over the points 1 to points - 1 of a straight way, cut into `points`, from the
   drone and from the tag, and largest heights over the ray between them, over the roots of the
   ways to both. The tables are 1 / i and 1 / sqrt(i), and the same from their ends. */
static void NAMED(profile)(const view_t *view, float step_c, float step_r, Py_ssize_t points,
                           float tag, float bulge, float best[3])
{
    const float c0 = view->column, r0 = view->row, rise = tag / points;
    const float *inverse = view->tables, *root = view->tables + view->most;
    const float *inverse_left = view->tables + 3 * view->most - points;
    const float *root_left = view->tables + 4 * view->most - points;
    const float *height = view->height;
    const int32_t stride = view->columns;
    const lanes_t low_start = (lanes_t){0} - 1e9f;
    lanes_t one = low_start, two = low_start, three = low_start, number;
    Py_ssize_t i = 1;
    for (int lane = 0; lane < LANES; lane++)
        number[lane] = 1.0f + lane;
    for (; i + LANES <= points; i += LANES, number += (float)LANES) {
        lanes_t c = c0 + step_c * number, r = r0 + step_r * number;
        const whole_t left = __builtin_convertvector(c, whole_t);
        const whole_t low = __builtin_convertvector(r, whole_t);
        const whole_t place = low * stride + left;
        lanes_t sw, se, nw, ne;
        for (int lane = 0; lane < LANES; lane++) {
            const float *at = height + place[lane];
            sw[lane] = at[0];
            se[lane] = at[1];
            nw[lane] = at[stride];
            ne[lane] = at[stride + 1];
        }
        c -= __builtin_convertvector(left, lanes_t);
        r -= __builtin_convertvector(low, lanes_t);
        const lanes_t south = sw + c * (se - sw), north = nw + c * (ne - nw);
        const lanes_t ground = south + r * (north - south) - bulge * number * number;
        const lanes_t a = ground * LOAD(inverse + i);
        const lanes_t b = (ground - tag) * LOAD(inverse_left + i);
        const lanes_t over = (ground - rise * number) * LOAD(root + i) * LOAD(root_left + i);
        one = LARGER(a, one);
        two = LARGER(b, two);
        three = LARGER(over, three);
    }
    best[0] = best[1] = best[2] = -1e9f;
    for (int lane = 0; lane < LANES; lane++) {
        best[0] = one[lane] > best[0] ? one[lane] : best[0];
        best[1] = two[lane] > best[1] ? two[lane] : best[1];
        best[2] = three[lane] > best[2] ? three[lane] : best[2];
    }
    for (; i < points; i++) {
        float c = c0 + step_c * i, r = r0 + step_r * i;
        const int32_t left = (int32_t)c, low = (int32_t)r;
        const float *at = height + low * stride + left;
        c -= left;
        r -= low;
        const float south = at[0] + c * (at[1] - at[0]);
        const float north = at[stride] + c * (at[stride + 1] - at[stride]);
        const float ground = south + r * (north - south) - bulge * i * i;
        const float a = ground * inverse[i], b = (ground - tag) * inverse_left[i];
        const float over = (ground - rise * i) * root[i] * root_left[i];
        best[0] = a > best[0] ? a : best[0];
        best[1] = b > best[1] ? b : best[1];
        best[2] = over > best[2] ? over : best[2];
    }
}

#undef whole_t
#undef LARGER

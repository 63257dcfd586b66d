/* All loops for one processor, whose vectors have LANES floats: included once for each VERSION. */
#if (LANES > 4 && !defined(__AVX2__)) || (LANES > 8 && !defined(__AVX512F__))
#error "vectors that are wider than the registers"
#endif
#define lanes_t NAMED(lanes)
typedef float lanes_t __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
#define LOAD(at) (*(const lanes_t *)(at))
#define STORE(at, value) (*(lanes_t *)(at) = (value))

#include "anchors_loops.h"
#include "bank_loops.h"
#include "beeps_loops.h"
#include "codes_loops.h"
#include "fir_loops.h"
/* After the filters, whose sums it uses. */
#include "band_loops.h"
#include "terrain_loops.h"
#include "trains_loops.h"

static const loops_t NAMED(loops) = {
    .decimate_outputs = NAMED(decimate_outputs),
    .largest_part = NAMED(largest_part),
    .bank_outputs = NAMED(bank_outputs),
    .band_outputs = NAMED(band_outputs),
    .cell_powers = NAMED(cell_powers),
    .window_powers = NAMED(window_powers),
    .find_anchors = NAMED(find_anchors),
    .best_sum = NAMED(best_sum),
    .profile = NAMED(profile),
    .code_clip = NAMED(code_clip),
    .code_sums = NAMED(code_sums),
    .code_highest = NAMED(code_highest),
    .code_add = NAMED(code_add),
    .code_windows = NAMED(code_windows),
    .train_block = NAMED(train_block),
    .train_highest = NAMED(train_highest),
};

#undef lanes_t
#undef LOAD
#undef STORE
#undef LANES
#undef VERSION

// Included by the passes of semi-global aggregation (Hirschmüller, PAMI 2008): one workgroup per path, four disparities
// per invocation. Such a pass defines the pixel of a step (`pixel_at`; steps beyond the end stay on the last one), its
// penalty P2 (`penalty_at`), the sum of the earlier paths (`sum_at`), and the storage of the new sum (`store_sum`).
// twin: src/depth/stereo/cpu/path.rs

const MAX_WORDS = 64u;
const PADDING = 0xffffffffu;

// The values at a pixel, between padding that is never the minimum; two buffers, for the current and the next pixel.
var<workgroup> states: array<array<u32, MAX_WORDS + 2u>, 2>;
// The minimum of the values at a pixel; the other two belong to the previous and the next pixel.
var<workgroup> least: array<atomic<u32>, 3>;

// Inputs of the next four pixels of a path, prefetched while the previous four are processed.
struct Prefetched {
    costs: vec4<u32>,
    sums: vec4<u32>,
    penalties: vec4<u32>,
}

fn prefetch(line: u32, step: u32, word: u32) -> Prefetched {
    let a = pixel_at(line, step);
    let b = pixel_at(line, step + 1u);
    let c = pixel_at(line, step + 2u);
    let d = pixel_at(line, step + 3u);
    let cells = vec4(a, b, c, d) * WORDS + word;
    return Prefetched(
        vec4(costs[cells.x], costs[cells.y], costs[cells.z], costs[cells.w]),
        vec4(sum_at(cells.x), sum_at(cells.y), sum_at(cells.z), sum_at(cells.w)),
        vec4(penalty_at(a), penalty_at(b), penalty_at(c), penalty_at(d)),
    );
}

fn init_path(word: u32) {
    if word == 0u {
        for (var side = 0u; side < 2u; side++) {
            states[side][0] = PADDING;
            states[side][WORDS + 1u] = PADDING;
        }
        atomicStore(&least[0], PADDING);
    }
    workgroupBarrier();
}

// Computes the values at the next pixel, number `step`, from those at the current one. Two buffers for the values and
// three for their minimum make one barrier sufficient.
fn advance(step: u32, word: u32, values: vec4<u32>, cost: vec4<u32>, penalty: u32) -> vec4<u32> {
    let side = step % 2u;
    states[side][word + 1u] = pack4xU8(values);
    atomicMin(&least[step % 3u], min_of(values));
    if word == 0u {
        atomicStore(&least[(step + 1u) % 3u], PADDING);
    }
    workgroupBarrier();
    let last = atomicLoad(&least[step % 3u]);
    let lower = vec4(states[side][word] >> 24u, values.xyz);
    let upper = vec4(values.yzw, states[side][word + 2u] & 255u);
    let near = min(lower, upper) + P1;
    return min(min(values, near), vec4(last + penalty)) - last + cost;
}

// Advances one step, and stores the sum plus half of the values.
fn advance_and_store(
    line: u32, step: u32, word: u32, values: vec4<u32>, cost: u32, sum: u32, penalty: u32,
) -> vec4<u32> {
    let next = advance(step, word, values, unpack4xU8(cost), penalty);
    // No byte overflows: three halves are at most 129.
    store_sum(line, step, word, sum + pack4xU8(next >> vec4(1u)));
    return next;
}

fn trace_path(line: u32, length: u32, word: u32) {
    init_path(word);
    // From zeros, the first step yields the costs.
    var values = vec4(0u);
    var ahead = prefetch(line, 0u, word);
    for (var step = 0u; step < length; step += 4u) {
        let now = ahead;
        ahead = prefetch(line, step + 4u, word);
        values = advance_and_store(line, step, word, values, now.costs.x, now.sums.x, now.penalties.x);
        values = advance_and_store(line, step + 1u, word, values, now.costs.y, now.sums.y, now.penalties.y);
        values = advance_and_store(line, step + 2u, word, values, now.costs.z, now.sums.z, now.penalties.z);
        values = advance_and_store(line, step + 3u, word, values, now.costs.w, now.sums.w, now.penalties.w);
    }
}

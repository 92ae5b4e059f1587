// Shared by the passes that go along paths: a workgroup goes along one, with four disparities in each invocation. Such
// a pass says which pixel a step comes to (`pixel_at`; steps beyond the end stay on the last one), which penalty holds
// there (`penalty_at`), what the paths before have left there (`sum_at`), and where to leave the new sum (`leave`).

const MOST_WORDS = 64u;
const NEVER_LEAST = 0xffffffffu;

// The values at a pixel, between words that are never the least; those of the next pixel go beside them.
var<workgroup> states: array<array<u32, MOST_WORDS + 2u>, 2>;
// The least of the values at a pixel; the other two are of the pixels before and after.
var<workgroup> least: array<atomic<u32>, 3>;

// What is known of the next four pixels of a path: fetched while it goes along those before.
struct Ahead {
    costs: vec4<u32>,
    sums: vec4<u32>,
    penalties: vec4<u32>,
}

fn fetch(line: u32, step: u32, word: u32) -> Ahead {
    let a = pixel_at(line, step);
    let b = pixel_at(line, step + 1u);
    let c = pixel_at(line, step + 2u);
    let d = pixel_at(line, step + 3u);
    let cells = vec4(a, b, c, d) * WORDS + word;
    return Ahead(
        vec4(costs[cells.x], costs[cells.y], costs[cells.z], costs[cells.w]),
        vec4(sum_at(cells.x), sum_at(cells.y), sum_at(cells.z), sum_at(cells.w)),
        vec4(penalty_at(a), penalty_at(b), penalty_at(c), penalty_at(d)),
    );
}

fn prepare(word: u32) {
    if word == 0u {
        for (var side = 0u; side < 2u; side++) {
            states[side][0] = NEVER_LEAST;
            states[side][WORDS + 1u] = NEVER_LEAST;
        }
        atomicStore(&least[0], NEVER_LEAST);
    }
    workgroupBarrier();
}

// From the values at a pixel to those at the next one, whose number is `step`. Two memories for the values and three
// for the least of them make one barrier enough.
fn go(step: u32, word: u32, values: vec4<u32>, cost: vec4<u32>, penalty: u32) -> vec4<u32> {
    let side = step % 2u;
    states[side][word + 1u] = pack4xU8(values);
    atomicMin(&least[step % 3u], least_of(values));
    if word == 0u {
        atomicStore(&least[(step + 1u) % 3u], NEVER_LEAST);
    }
    workgroupBarrier();
    let last = atomicLoad(&least[step % 3u]);
    let lower = vec4(states[side][word] >> 24u, values.xyz);
    let upper = vec4(values.yzw, states[side][word + 2u] & 255u);
    let near = min(lower, upper) + SLOPE;
    return min(min(values, near), vec4(last + penalty)) - last + cost;
}

// Goes one step, and leaves the sum with half of the values there.
fn leave_after(
    line: u32, step: u32, word: u32, values: vec4<u32>, cost: u32, sum: u32, penalty: u32,
) -> vec4<u32> {
    let next = go(step, word, values, unpack4xU8(cost), penalty);
    // No byte runs over: three halves are at most 129.
    leave(line, step, word, sum + pack4xU8(next >> vec4(1u)));
    return next;
}

fn walk(line: u32, length: u32, word: u32) {
    prepare(word);
    // From nothing, the first step comes to the costs.
    var values = vec4(0u);
    var ahead = fetch(line, 0u, word);
    for (var step = 0u; step < length; step += 4u) {
        let now = ahead;
        ahead = fetch(line, step + 4u, word);
        values = leave_after(line, step, word, values, now.costs.x, now.sums.x, now.penalties.x);
        values = leave_after(line, step + 1u, word, values, now.costs.y, now.sums.y, now.penalties.y);
        values = leave_after(line, step + 2u, word, values, now.costs.z, now.sums.z, now.penalties.z);
        values = leave_after(line, step + 3u, word, values, now.costs.w, now.sums.w, now.penalties.w);
    }
}

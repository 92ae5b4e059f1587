// Included by the passes with a workgroup per row, whose invocations process adjacent columns each. Each invocation
// publishes its result in workgroup memory, where the others search for it.

const INVOCATIONS = 128u;

// Returns the first column of an invocation and the end of its range, which is empty for more invocations than columns.
fn columns_of(invocation: u32) -> vec2<u32> {
    let each = (WIDTH + INVOCATIONS - 1u) / INVOCATIONS;
    return min(vec2(invocation, invocation + 1u) * each, vec2(WIDTH));
}

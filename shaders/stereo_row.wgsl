// Shared by the passes in which a workgroup has a row, and each of its invocations columns side by side. What goes from
// one to the next is left in workgroup memory, once for each invocation, where the others look for it.

const INVOCATIONS = 128u;

// From the first column of an invocation up to the other one; none where there are fewer columns than invocations.
fn columns_of(invocation: u32) -> vec2<u32> {
    let each = (WIDTH + INVOCATIONS - 1u) / INVOCATIONS;
    return min(vec2(invocation, invocation + 1u) * each, vec2(WIDTH));
}

// Included by counting passes: prefix sums over a workgroup (Hillis and Steele 1986).

var<workgroup> sums: array<u32, BLOCK>;

// Exclusive prefix sum: the sum of `own` of all threads before this one.
fn exclusive_prefix_sum(own: u32, thread: u32) -> u32 {
    sums[thread] = own;
    workgroupBarrier();
    for (var by = 1u; by < BLOCK; by *= 2u) {
        let other = sums[select(0u, thread - by, thread >= by)];
        workgroupBarrier();
        if thread >= by {
            sums[thread] += other;
        }
        workgroupBarrier();
    }
    return sums[thread] - own;
}

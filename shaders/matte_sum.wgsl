// Shared by the passes that count: sums over the threads of a workgroup of a block.

var<workgroup> sums: array<u32, BLOCK>;

// The sum of the numbers of all threads before this one.
fn sum_before(own: u32, thread: u32) -> u32 {
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

// Shared by the passes that find a quantile, in one workgroup. Such a pass has `samples`: each thread writes and reads those
// whose number is its own, and so on in steps of `THREADS`. Their values are bits of numbers that are not negative; `NONE`
// is no sample.

const THREADS = 256u;
const NONE = 0xffffffffu;

var<workgroup> found: atomic<u32>;

// How many of so many samples are below a value.
fn count_below(value: u32, length: u32, thread: u32) -> u32 {
    if thread == 0u {
        atomicStore(&found, 0u);
    }
    var count = 0u;
    for (var n = thread; n < length; n += THREADS) {
        count += select(0u, 1u, samples[n] < value);
    }
    workgroupBarrier();
    atomicAdd(&found, count);
    return workgroupUniformLoad(&found);
}

// The sample that so many others are below, or as large: the largest value with no more samples below it, bit by bit.
fn sample_of_rank(rank: u32, length: u32, thread: u32) -> u32 {
    var value = 0u;
    for (var bit = 31u; bit > 0u; bit--) {
        let larger = value | (1u << (bit - 1u));
        if count_below(larger, length, thread) <= rank {
            value = larger;
        }
    }
    return value;
}

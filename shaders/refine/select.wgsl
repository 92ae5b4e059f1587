// Included by the passes that find a quantile, in one workgroup. They bind `samples`, which thread `t` accesses at `t`
// and in steps of `THREADS` from there. Values are the bits of non-negative floats, which sort like integers; `NONE` is
// no sample.

const THREADS = 256u;
const NONE = 0xffffffffu;

var<workgroup> found: atomic<u32>;

// Counts the samples below a value, of `length`.
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

// Returns the sample of a rank by radix selection: the largest value with at most `rank` samples below it, bit by bit.
fn select_rank(rank: u32, length: u32, thread: u32) -> u32 {
    var value = 0u;
    for (var bit = 31u; bit > 0u; bit--) {
        let larger = value | (1u << (bit - 1u));
        if count_below(larger, length, thread) <= rank {
            value = larger;
        }
    }
    return value;
}

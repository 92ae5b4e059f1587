// Pass matte_total, one workgroup: number of set bits before each block, and in all. In the first run the bits are
// edges; in the second, mixed pixels: their number, and that of the edges found, is written before the list of mixed pixels.

@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> mixed: array<vec4<u32>>;     // two for the counts, and two a pixel

@compute @workgroup_size(BLOCK)
fn matte_total(@builtin(local_invocation_index) thread: u32) {
    let blocks = (words_across() * frame.size.y + BLOCK - 1u) / BLOCK;
    let each = (blocks + BLOCK - 1u) / BLOCK;
    let begin = min(thread * each, blocks);
    let end = min(begin + each, blocks);
    var own = 0u;
    for (var k = begin; k < end; k++) {
        own += counts[TOTALS + k];
    }
    var before = exclusive_prefix_sum(own, thread);
    if thread == BLOCK - 1u {
        let all = before + own;
        if AGAIN == 0u {
            counts[EDGES] = all;
            counts[NEXT] = all;
        } else {
            var found = 0u;
            for (var size = 0u; size < SIZES; size++) {
                found += counts[STEP_SIZES + size];
            }
            mixed[0] = vec4(all, found, 0u, 0u);
        }
    }
    for (var k = begin; k < end; k++) {
        let of_block = counts[TOTALS + k];
        counts[TOTALS + k] = before;
        before += of_block;
    }
}

// Pass matte_count: number of set bits before each word of its block, and in the block (prefix sum).

@group(0) @binding(1) var<storage, read_write> words: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(BLOCK)
fn matte_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let k = group.x * BLOCK + thread;
    let is_there = k < words_across() * frame.size.y;
    var own = 0u;
    if is_there {
        own = countOneBits(words[k].x);
    }
    let before = exclusive_prefix_sum(own, thread);
    if is_there {
        words[k].y = before;
    }
    if thread == BLOCK - 1u {
        counts[TOTALS + group.x] = before + own;
    }
}

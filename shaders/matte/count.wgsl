// Pass matte_count: number of set bits before each word of its block, and in the block (prefix sum). In the first run the
// bits are edges; if there are too many, those go first whose size of step most have.
// twin: src/depth/matting/rank.rs

@group(0) @binding(1) var<storage, read> metres: array<u32>;
@group(0) @binding(2) var<storage, read_write> words: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

// Sizes of step to drop, as bits.
var<workgroup> dropped: atomic<u32>;

// Whether the pixels with this size, and with all that are as rare or rarer, are too many.
fn is_too_common(size: u32) -> bool {
    let own = counts[STEP_SIZES + size];
    var together = 0u;
    for (var other = 0u; other < SIZES; other++) {
        let count = counts[STEP_SIZES + other];
        together += select(0u, count, count < own || (count == own && other >= size));
    }
    return together > frame.max_entries / 4u * 3u;
}

// The bits of a word without those of dropped sizes.
fn keep_rare_steps(word: u32, sizes: u32) -> u32 {
    var bits = words[word].x;
    var kept = bits;
    while bits != 0u {
        let bit = firstTrailingBit(bits);
        bits &= bits - 1u;
        let pixel = vec2(word % words_across() * WORD + bit, word / words_across());
        var near = 0.0;
        let own = inverse_depth(metres[pixel.y * frame.size.x + pixel.x]);
        var far = own;
        for (var k = 0u; k < 9u; k++) {
            let other = min(max(pixel + vec2(k % 3u, k / 3u), vec2(1u)) - 1u, frame.size - 1u);
            let inverse = inverse_depth(metres[other.y * frame.size.x + other.x]);
            near = max(near, inverse);
            far = min(far, inverse);
        }
        kept &= ~(((sizes >> size_of_step(near, far, own)) & 1u) << bit);
    }
    return kept;
}

@compute @workgroup_size(BLOCK)
fn matte_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if thread == 0u {
        atomicStore(&dropped, 0u);
    }
    workgroupBarrier();
    if AGAIN == 0u && thread < SIZES && is_too_common(thread) {
        atomicOr(&dropped, 1u << thread);
    }
    workgroupBarrier();
    let k = group.x * BLOCK + thread;
    let is_there = k < words_across() * frame.size.y;
    var own = 0u;
    if is_there {
        let sizes = atomicLoad(&dropped);
        if sizes != 0u {
            words[k].x = keep_rare_steps(k, sizes);
        }
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

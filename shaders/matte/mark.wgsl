// Pass matte_mark: marks the mixed pixels, as bits.

@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(3) var<storage, read_write> words: array<atomic<u32>>;   // bits, and the count of `matte_count`

@compute @workgroup_size(64)
fn matte_mark(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var k = id.x; k < counts[NEXT]; k += 64u * groups.x) {
        let flags = atomicLoad(&entries[k].flags);
        let alpha = select(entries[k].alpha, 0.0, (flags & WIDE) != 0u);
        let is_mixed = select(alpha >= 1.0 - NEARLY_PURE, alpha <= NEARLY_PURE, (flags & NEAR) != 0u);
        if is_mixed && (flags & LONE) == 0u {
            let at = entries[k].at;
            let word = at / frame.size.x * words_across() + at % frame.size.x / WORD;
            atomicOr(&words[2u * word], 1u << (at % frame.size.x % WORD));
            atomicOr(&entries[k].flags, MIXED);
        }
    }
}

// Pass refine_agree: accepts claims for the near side that two of three neighbours across the claiming lines share.
// twin: `accept_claims` in src/depth/guided_fill.rs

@group(0) @binding(1) var<storage, read> claims: array<f32>;
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> metres: array<f32>;

@compute @workgroup_size(16, 16)
fn refine_agree(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let k = id.y * frame.size.x + id.x;
    if (flags[k] & HOLE) == 0u {
        return;
    }
    let across = select(frame.size.x, 1u, DOWN == 1u);
    let last = frame.size.x * frame.size.y - 1u;
    let own = claims[k];
    let before = select(0.0, claims[max(k, across) - across], k >= across);
    let after = select(0.0, claims[min(k + across, last)], k + across <= last);
    if select(0u, 1u, own > 0.0) + select(0u, 1u, before > 0.0) + select(0u, 1u, after > 0.0) >= 2u {
        metres[k] = select(min(before, after), own, own > 0.0);
        flags[k] &= ~HOLE;
    }
}

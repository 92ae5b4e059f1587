// Pass push, of push-pull inpainting: what a level of the pyramid does not know, from the next coarser one (linear
// interpolation).

// The other coarse pixel that a fine one lies between, along one axis.
fn neighbour(at: u32, limit: u32) -> u32 {
    let half = at / 2u;
    return select(min(half + 1u, limit - 1u), half - min(half, 1u), at % 2u == 0u);
}

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn push(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= level.fine) {
        return;
    }
    let index = level.fine_offset + id.y * level.fine.x + id.x;
    let missing = 1.0 - known[index];
    if missing <= 0.0 {
        return;
    }
    let xs = vec2(id.x / 2u, neighbour(id.x, level.coarse.x));
    let ys = vec2(id.y / 2u, neighbour(id.y, level.coarse.y));
    var sum = vec4(0.0);
    var knows = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let weight = select(0.75, 0.25, k % 2u == 1u) * select(0.75, 0.25, k / 2u == 1u);
        let behind = level.coarse_offset + ys[k / 2u] * level.coarse.x + xs[k % 2u];
        sum += weight * pyramid[behind];
        knows += weight * known[behind];
    }
    let scale = missing / max(knows, 1.0e-6);
    pyramid[index] += sum * scale;
    known[index] += knows * scale;
}

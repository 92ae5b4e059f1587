// Pass pull, of push-pull inpainting: one level of the pyramid to the next coarser one, known pixels only.

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn pull(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= level.coarse) {
        return;
    }
    var sum = vec4(0.0);
    var knows = 0.0;
    for (var sub = 0u; sub < 4u; sub++) {
        let at = 2u * id.xy + vec2(sub % 2u, sub / 2u);
        if all(at < level.fine) {
            let index = level.fine_offset + at.y * level.fine.x + at.x;
            sum += pyramid[index];
            knows += known[index];
        }
    }
    let scale = 1.0 / max(knows, 1.0);
    let index = level.coarse_offset + id.y * level.coarse.x + id.x;
    pyramid[index] = sum * scale;
    known[index] = knows * scale;
}

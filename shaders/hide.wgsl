// Pass hide, the occlusion mask: at half size, whether any near object touches a pixel. Reads the scene only where a
// tile has any.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> hidden: array<f32>;
@group(0) @binding(3) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> mixed: array<MixedPixel>;

fn hidden_at(coc_px: f32) -> f32 {
    return 1.0 - step_at(frame.unhidden, coc_px);
}

@compute @workgroup_size(TILE, TILE)
fn hide(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = (frame.size + 1u) / 2u;
    if any(id.xy >= size) {
        return;
    }
    var most = 0.0;
    let nearest_px = ranges[tile_of(2u * id.xy, frame.size.x, vec2(TILE))].x;
    for (var sub = 0u; sub < 4u && step_at(frame.unhidden, nearest_px) < 1.0; sub++) {
        let at = min(2u * id.xy + vec2(sub % 2u, sub / 2u), frame.size - 1u);
        let pixel = at.y * frame.size.x + at.x;
        let value = scene[pixel];
        most = max(most, hidden_at(scene_unpacked(value, frame.most_px).w));
        // What something near covers in part is not known either.
        if is_mixed(value) {
            most = max(most, hidden_at(near_surface(first_mixed(pixel)).w));
        }
    }
    hidden[id.y * size.x + id.x] = most;
}

// Pass find_occluders: CoC of the nearest surface at half size, the possible occluders. Reads the scene only in tiles
// with anything in front of the focal plane; elsewhere nothing occludes, and the result is 0.
// twin: src/bokeh/cpu/fill.rs (`HalfPictureBand`)

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> nearest_px: array<f32>;
@group(0) @binding(3) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> mixed: array<MixedPixel>;

@compute @workgroup_size(TILE, TILE)
fn find_occluders(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = (frame.size + 1u) / 2u;
    if any(id.xy >= size) {
        return;
    }
    var nearest = 0.0;
    let some = ranges[tile_index(2u * id.xy, frame.size.x, vec2(TILE))].x < 0.0;
    for (var sub = 0u; sub < 4u && some; sub++) {
        let at = min(2u * id.xy + vec2(sub % 2u, sub / 2u), frame.size - 1u);
        let pixel = at.y * frame.size.x + at.x;
        let value = scene[pixel];
        nearest = min(nearest, unpack_scene(value, frame.max_px).w);
        // A pixel that a near surface covers partly is not known either.
        if is_mixed(value) {
            nearest = min(nearest, load_near_surface(find_mixed_index(pixel)).w);
        }
    }
    nearest_px[id.y * size.x + id.x] = nearest;
}

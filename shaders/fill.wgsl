// Pass fill, the inpainting of disocclusions: in the scene, near objects become what lies behind.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> pyramid: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> scene: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> ranges: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> known: array<f32>;
@group(0) @binding(5) var<storage, read_write> mixed: array<MixedPixel>;

// A surface as far as it is not hidden, and else what lies behind.
fn filled(surface: vec4<f32>, behind: u32) -> vec2<u32> {
    let hidden = 1.0 - step_at(frame.unhidden, surface.w);
    let value = mix(surface, pyramid[behind], hidden);
    let result = scene_packed(value.rgb, max(value.w, frame.nearest_px), frame.most_px);
    range_add(scene_unpacked(result, frame.most_px).w);
    return result;
}

@compute @workgroup_size(TILE, TILE)
fn fill(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32,
        @builtin(workgroup_id) tile: vec3<u32>, @builtin(num_workgroups) tiles: vec3<u32>) {
    let index = tile.y * tiles.x + tile.x;
    if thread == 0u {
        atomicStore(&lowest, key_of(ranges[index].x));
        atomicStore(&highest, key_of(ranges[index].y));
    }
    workgroupBarrier();
    // What a silhouette only touches keeps its own colour: it is seen, and filling would smear it.
    let inside = min(id.xy, frame.size - 1u);
    let pixel = inside.y * frame.size.x + inside.x;
    let value = scene[pixel];
    let own = scene_unpacked(value, frame.most_px);
    let behind = inside.y / 2u * ((frame.size.x + 1u) / 2u) + inside.x / 2u;
    // Where something near touches every pixel nothing is known, and nothing lies behind.
    if all(id.xy < frame.size) && known[behind] > 0.5 {
        if step_at(frame.unhidden, own.w) < 1.0 {
            let result = filled(own, behind);
            scene[pixel] = vec2(result.x, result.y | (value.y & MIXED));
        }
        if is_mixed(value) {
            let place = first_mixed(pixel);
            let near = near_surface(place);
            if step_at(frame.unhidden, near.w) < 1.0 {
                let result = filled(near, behind);
                mixed[place].near = result.x;
                mixed[place].far = result.y;
            }
        }
    }
    workgroupBarrier();
    if thread == 0u {
        ranges[index] = vec2(value_of(atomicLoad(&lowest)), value_of(atomicLoad(&highest)));
    }
}

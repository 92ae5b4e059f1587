// Pass fill, the inpainting of disocclusions: in the scene, near objects become what lies behind.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> pyramid: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> scene: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> ranges: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> known: array<f32>;

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
    let own = scene_unpacked(scene[inside.y * frame.size.x + inside.x], frame.most_px);
    let hidden = 1.0 - step_at(frame.unhidden, own.w);
    let behind = inside.y / 2u * ((frame.size.x + 1u) / 2u) + inside.x / 2u;
    // Where something near touches every pixel nothing is known, and nothing lies behind.
    if all(id.xy < frame.size) && hidden > 0.0 && known[behind] > 0.5 {
        let value = mix(own, pyramid[behind], hidden);
        let filled = scene_packed(value.rgb, max(value.w, frame.nearest_px), frame.most_px);
        scene[id.y * frame.size.x + id.x] = filled;
        range_add(scene_unpacked(filled, frame.most_px).w);
    }
    workgroupBarrier();
    if thread == 0u {
        ranges[index] = vec2(value_of(atomicLoad(&lowest)), value_of(atomicLoad(&highest)));
    }
}

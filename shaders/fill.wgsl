// Pass fill, the inpainting of disocclusions: the scene as a layer sees it, where what lies in front of the layer has become
// what lies behind that. Reads the scene; writes that of the layer, and its ranges of CoC.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> pyramid: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> known: array<f32>;
@group(0) @binding(4) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> behind: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> ranges_behind: array<vec2<f32>>;

// How far what is filled in behind a pixel is another surface, told by their CoC: what comes nearer, such as the ground, hides
// its own continuation, which looks like it.
fn other_surface(own_px: f32, behind_px: f32) -> f32 {
    let step = (own_px - behind_px) / min(own_px, -1.0e-3);
    return clamp((step - OTHER_FROM) / (OTHER_TO - OTHER_FROM), 0.0, 1.0);
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
    if all(id.xy < frame.size) {
        let pixel = id.y * frame.size.x + id.x;
        var value = scene[pixel];
        let own = scene_unpacked(value, frame.most_px);
        let half = id.y / 2u * ((frame.size.x + 1u) / 2u) + id.x / 2u;
        let unhidden = step_at(work.unhidden, own.w);
        // What a silhouette only touches keeps its own colour: it is seen, and filling would smear it. Where something near
        // touches every pixel nothing is known, and nothing lies behind.
        if unhidden < 1.0 && known[half] > 0.5 {
            let found = pyramid[half];
            let hidden = (1.0 - unhidden) * other_surface(own.w, found.w);
            if hidden > 0.0 {
                let mixture = mix(own, vec4(found.rgb, max(found.w, work.nearest_px)), hidden);
                let result = scene_packed(mixture.rgb, mixture.w, frame.most_px);
                range_add(scene_unpacked(result, frame.most_px).w);
                value = vec2(result.x, result.y | (value.y & MIXED));
            }
        }
        behind[pixel] = value;
    }
    workgroupBarrier();
    if thread == 0u {
        ranges_behind[index] = vec2(value_of(atomicLoad(&lowest)), value_of(atomicLoad(&highest)));
    }
}

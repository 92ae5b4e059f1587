// Pass unpack: 8-bit sRGB to linear light with highlights expanded; depth to signed CoC.
// Reads packed RGB bytes and metres; writes linear r, g, b and the CoC in pixels, and the range of CoC of every tile.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> color: array<u32>;
@group(0) @binding(2) var<storage, read> depth: array<f32>;
@group(0) @binding(3) var<storage, read_write> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> ranges: array<vec2<f32>>;

fn light_of(index: u32) -> f32 {
    let code = f32((color[index / 4u] >> (8u * (index % 4u))) & 255u) / 255.0;
    return select(pow((code + 0.055) / 1.055, 2.4), code / 12.92, code <= 0.04045);
}

fn coc_of(x: u32, y: u32) -> f32 {
    if frame.coc_kind == 0u {
        return frame.coc.x;
    }
    if frame.coc_kind == 1u {
        let distance_px = abs(frame.coc.x * f32(x) + frame.coc.y * f32(y) - frame.coc.z) - frame.coc.w;
        return min(max(distance_px, 0.0) * frame.ramp.x, frame.ramp.y);
    }
    let column = min((2u * x + 1u) * frame.depth_size.x / (2u * frame.size.x), frame.depth_size.x - 1u);
    let row = min((2u * y + 1u) * frame.depth_size.y / (2u * frame.size.y), frame.depth_size.y - 1u);
    let metres = depth[row * frame.depth_size.x + column];
    // Unknown depth counts as infinitely far. The largest finite number stands in for infinity.
    var inverse_m = 0.0;
    if metres > 0.0 && metres < 3.0e38 {
        inverse_m = 1.0 / metres;
    }
    // 1 within the sharp range, and what is nearer to 1 of both its ends without.
    let ratio = max(frame.coc.y * inverse_m, min(frame.coc.z * inverse_m, 1.0));
    return clamp(frame.coc.x * (1.0 - ratio), -frame.coc.w, frame.coc.w);
}

@compute @workgroup_size(TILE, TILE)
fn unpack(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32,
          @builtin(workgroup_id) tile: vec3<u32>, @builtin(num_workgroups) tiles: vec3<u32>) {
    if thread == 0u {
        atomicStore(&lowest, 0x7fffffff);
        atomicStore(&highest, -0x7fffffff);
    }
    workgroupBarrier();
    if all(id.xy < frame.size) {
        let pixel = id.y * frame.size.x + id.x;
        var light = vec3(light_of(3u * pixel), light_of(3u * pixel + 1u), light_of(3u * pixel + 2u));
        if frame.expansion > 0.0 {
            light *= frame.expansion / (frame.expansion - luminance(light));
        }
        let value = scene_packed(light, coc_of(id.x, id.y), frame.most_px);
        scene[pixel] = value;
        // What the others read, rounding included.
        range_add(scene_unpacked(value, frame.most_px).w);
    }
    workgroupBarrier();
    if thread == 0u {
        ranges[tile.y * tiles.x + tile.x] = vec2(value_of(atomicLoad(&lowest)), value_of(atomicLoad(&highest)));
    }
}

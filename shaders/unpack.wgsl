// Pass unpack: 8-bit sRGB to linear light with highlights expanded; depth to signed CoC; mixed pixels to two surfaces.
// Reads packed RGB bytes and metres; writes linear r, g, b and the CoC in pixels, and the range of CoC of every tile.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> color: array<u32>;
@group(0) @binding(2) var<storage, read> depth: array<f32>;
@group(0) @binding(3) var<storage, read_write> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> ranges: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> mixed: array<MixedPixel>;

// Of each pixel of the tile: its place among the mixed ones, plus one.
var<workgroup> places: array<u32, TILE * TILE>;

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
    return coc_of_depth(depth[row * frame.depth_size.x + column]);
}

fn coc_of_depth(metres: f32) -> f32 {
    // Unknown depth counts as infinitely far. The largest finite number stands in for infinity.
    var inverse_m = 0.0;
    if metres > 0.0 && metres < 3.0e38 {
        inverse_m = 1.0 / metres;
    }
    // 1 within the sharp range, and what is nearer to 1 of both its ends without.
    let ratio = max(frame.coc.y * inverse_m, min(frame.coc.z * inverse_m, 1.0));
    return clamp(frame.coc.x * (1.0 - ratio), -frame.coc.w, frame.coc.w);
}

// Notes which pixels of a row of the tile are mixed.
fn find_mixed(first: vec2<u32>, row: u32) {
    let start = (first.y + row) * frame.size.x + first.x;
    let end = start + min(TILE, frame.size.x - first.x);
    for (var k = first_mixed(start); k < frame.mixed && mixed[k].at < end; k++) {
        places[row * TILE + mixed[k].at - start] = k + 1u;
    }
}

// Writes the nearer surface of a mixed pixel, and returns the farther one.
fn take_apart(k: u32, light: vec3<f32>) -> vec2<u32> {
    let own = mixed[k];
    // Both colours are as bright as the pixel's highlights are made: their sum stays the pixel.
    var factor = 1.0;
    if frame.expansion > 0.0 {
        factor = (frame.expansion + luminance(light)) / frame.expansion;
    }
    let difference = factor * vec3(own.red, own.green, own.blue);
    // Depth may be that of another frame, with other colours: no light is below 0.
    let near_light = max(light + (1.0 - own.share) * difference, vec3(0.0));
    let far_light = max(light - own.share * difference, vec3(0.0));
    let near = scene_packed(near_light, coc_of_depth(bitcast<f32>(own.near)), frame.most_px);
    let far = scene_packed(far_light, coc_of_depth(bitcast<f32>(own.far)), frame.most_px);
    mixed[k].near = near.x;
    mixed[k].far = near.y;
    range_add(scene_unpacked(near, frame.most_px).w);
    return vec2(far.x, far.y | MIXED);
}

@compute @workgroup_size(TILE, TILE)
fn unpack(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32,
          @builtin(workgroup_id) tile: vec3<u32>, @builtin(num_workgroups) tiles: vec3<u32>) {
    if thread == 0u {
        atomicStore(&lowest, 0x7fffffff);
        atomicStore(&highest, -0x7fffffff);
    }
    if frame.mixed > 0u && thread % TILE == 0u && id.y < frame.size.y {
        find_mixed(tile.xy * TILE, thread / TILE);
    }
    workgroupBarrier();
    if all(id.xy < frame.size) {
        let pixel = id.y * frame.size.x + id.x;
        var light = vec3(light_of(3u * pixel), light_of(3u * pixel + 1u), light_of(3u * pixel + 2u));
        if frame.expansion > 0.0 {
            light *= frame.expansion / (frame.expansion - luminance(light));
        }
        var value = scene_packed(light, coc_of(id.x, id.y), frame.most_px);
        if places[thread] > 0u {
            value = take_apart(places[thread] - 1u, light);
        }
        scene[pixel] = value;
        // What the others read, rounding included.
        range_add(scene_unpacked(value, frame.most_px).w);
    }
    workgroupBarrier();
    if thread == 0u {
        ranges[tile.y * tiles.x + tile.x] = vec2(value_of(atomicLoad(&lowest)), value_of(atomicLoad(&highest)));
    }
}

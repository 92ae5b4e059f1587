// Pass refine_claim: guided hole filling along a row, then down a column for the rest, by the thread at the first pixel
// of each hole: claims pixels for the nearer side as long as their colour is closer to it than to the other side.
// twin: `claim_run` in src/depth/guided_fill.rs

@group(0) @binding(1) var<storage, read> flags: array<u32>;
@group(0) @binding(2) var<storage, read> metres: array<f32>;
@group(0) @binding(3) var<storage, read> colors: array<u32>;
@group(0) @binding(4) var<storage, read_write> claims: array<f32>;

fn is_hole(k: u32) -> bool {
    return (flags[k] & HOLE) != 0u;
}

// Returns the mean colour of `count` pixels.
fn mean_color(start: u32, step: u32, count: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var n = 0u; n < count; n++) {
        sum += unpack_color(colors[start + n * step]);
    }
    return sum / f32(count);
}

@compute @workgroup_size(16, 16)
fn refine_claim(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let step = select(1u, frame.size.x, DOWN == 1u);
    let place = id[DOWN];
    let length = frame.size[DOWN];
    let start = id.y * frame.size.x + id.x;
    if place == 0u || !is_hole(start) || is_hole(start - step) {
        return;
    }
    // Counts one pixel more than the limit, to detect holes that are too long.
    var count = 1u;
    while count <= frame.max_hole_px && place + count < length && is_hole(start + count * step) {
        count++;
    }
    if count > frame.max_hole_px || place + count == length {
        return;
    }
    let end = start + count * step;
    let before_m = metres[start - step];
    let after_m = metres[end];
    let is_before = before_m * HOLE_SURFACE < after_m;
    if !is_before && !(after_m * HOLE_SURFACE < before_m) {
        return;
    }
    let samples = min(place, SAMPLE_PX);
    let before = mean_color(start - samples * step, step, samples);
    let after = mean_color(end, step, min(length - place - count, SAMPLE_PX));
    var near = select(after, before, is_before);
    let far = select(before, after, is_before);
    let near_m = select(after_m, before_m, is_before);
    for (var n = 0u; n < count; n++) {
        let k = start + select(count - 1u - n, n, is_before) * step;
        let own = unpack_color(colors[k]);
        if distance(own, near) * COLOR_PREFERENCE >= distance(own, far) {
            break;
        }
        claims[k] = near_m;
        near += COLOR_UPDATE_RATE * (own - near);
    }
}

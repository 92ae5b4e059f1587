// Draws a picture of packed RGB bytes into the window: scaled, mirrored, split or greyed, with background around it.
// twin: crates/window/src/present/soft/picture.rs

// Parameters of one drawing.
struct Window {
    area: vec4<u32>,            // of the picture in the window: left, top, width, height
    size: vec2<u32>,            // of the picture
    split: u32,                 // left of this column of the area, the picture before the blur is shown
    mirror: u32,                // 1: mirrored
    stale: vec4<f32>,           // luma weights of red, green and blue; w is 1 if the picture is shown grey
    divider: vec4<u32>,         // edges of the split line's three stripes, in columns of the area
    visible_region: vec4<u32>,  // z > 0: integer zoom factor; x, y: first visible column and row of the zoomed picture
    stripes: array<vec4<f32>, 3>,
    background: vec4<f32>,      // w is 1 if the target expects linear light
}

@group(0) @binding(0) var<uniform> window: Window;
@group(0) @binding(1) var<storage, read> picture: array<u32>;
@group(0) @binding(2) var<storage, read> before: array<u32>;

fn load_word(index: u32, is_before: bool) -> u32 {
    if is_before {
        return before[index];
    }
    return picture[index];
}

// Loads a pixel's colour; its bytes may span two words.
fn load_pixel(x: u32, y: u32, is_before: bool) -> vec3<f32> {
    let byte = 3u * (y * window.size.x + x);
    let shift = 8u * (byte % 4u);
    var bits = load_word(byte / 4u, is_before) >> shift;
    if shift > 8u {
        bits |= load_word(byte / 4u + 1u, is_before) << (32u - shift);
    }
    return unpack4x8unorm(bits).rgb;
}

// A tent filter along one axis: bilinear when enlarging; when shrinking, its radius is one output pixel, against
// aliasing.
struct TentTaps {
    first: u32,
    count: u32,
    center: f32,
    radius: f32,
}

fn tent_taps(place: u32, side: u32, scaled: u32) -> TentTaps {
    let ratio = f32(side) / f32(scaled);
    let radius = max(ratio, 1.0);
    let center = (f32(place) + 0.5) * ratio - 0.5;
    let count = min(u32(ceil(2.0 * radius)), side);
    let first = clamp(floor(center - radius) + 1.0, 0.0, f32(side - count));
    return TentTaps(u32(first), count, center, radius);
}

fn tent_weight(tent: TentTaps, tap: u32) -> f32 {
    return max(1.0 - abs(f32(tap) - tent.center) / tent.radius, 0.0);
}

fn sample_filtered(place: vec2<u32>, is_before: bool) -> vec3<f32> {
    let across = tent_taps(place.x, window.size.x, window.area.z);
    let down = tent_taps(place.y, window.size.y, window.area.w);
    var sum = vec4(0.0);
    for (var y = down.first; y < down.first + down.count; y++) {
        var row = vec4(0.0);
        for (var x = across.first; x < across.first + across.count; x++) {
            row += tent_weight(across, x) * vec4(load_pixel(x, y, is_before), 1.0);
        }
        sum += tent_weight(down, y) * row;
    }
    return sum.rgb / sum.w;
}

fn shade(place: vec2<u32>) -> vec3<f32> {
    for (var k = 0u; k < 3u; k++) {
        if place.x >= window.divider[k] && place.x < window.divider[k + 1u] {
            return window.stripes[k].rgb;
        }
    }
    let is_before = place.x < window.split;
    let factor = window.visible_region.z;
    let visible = place + window.visible_region.xy;
    let whole = select(window.area.z, window.size.x * factor, factor > 0u);
    let column = select(visible.x, whole - 1u - visible.x, window.mirror == 1u);
    var color: vec3<f32>;
    if factor > 0u {
        color = load_pixel(column / factor, visible.y / factor, is_before);
    } else if all(window.size == window.area.zw) {
        color = load_pixel(column, place.y, is_before);
    } else {
        color = sample_filtered(vec2(column, place.y), is_before);
    }
    return select(color, vec3(dot(color, window.stale.rgb)), window.stale.w == 1.0);
}

fn decode_srgb(code: vec3<f32>) -> vec3<f32> {
    return select(pow((code + 0.055) / 1.055, vec3(2.4)), code / 12.92, code <= vec3(0.04045));
}

// A full-screen triangle.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(index % 2u) * 4.0 - 1.0, f32(index / 2u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn present(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    // Left of or above the area, this wraps around to a huge value, which is outside as well.
    let place = vec2<u32>(at.xy) - window.area.xy;
    var color = window.background.rgb;
    if all(place < window.area.zw) {
        color = shade(place);
    }
    return vec4(select(color, decode_srgb(color), window.background.w == 1.0), 1.0);
}

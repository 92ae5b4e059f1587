// Draws a picture of packed RGB bytes into the window: scaled, mirrored, split and grey as the window wants it, with the
// background around it.

// One drawing.
struct Window {
    area: vec4<u32>,                // of the picture in the window: left, top, columns, rows
    size: vec2<u32>,                // of the picture
    split: u32,                     // left of this column of the area, the picture before the blur is shown
    mirror: u32,                    // 1: flipped left to right
    stale: vec4<f32>,               // weights of red, green and blue where all is grey; w is 1 then
    divider: vec4<u32>,             // the edges of its three stripes, in columns of the area
    part: vec4<u32>,                // z > 0: pixels are squares of that side, seen from column x and row y on
    stripes: array<vec4<f32>, 3>,
    background: vec4<f32>,          // w is 1 where the window wants linear light
}

@group(0) @binding(0) var<uniform> window: Window;
@group(0) @binding(1) var<storage, read> picture: array<u32>;
@group(0) @binding(2) var<storage, read> before: array<u32>;

fn word(index: u32, is_before: bool) -> u32 {
    if is_before {
        return before[index];
    }
    return picture[index];
}

// A pixel's colour; its bytes may lie in two words.
fn pixel(x: u32, y: u32, is_before: bool) -> vec3<f32> {
    let byte = 3u * (y * window.size.x + x);
    let shift = 8u * (byte % 4u);
    var bits = word(byte / 4u, is_before) >> shift;
    if shift > 8u {
        bits |= word(byte / 4u + 1u, is_before) << (32u - shift);
    }
    return unpack4x8unorm(bits).rgb;
}

// A tent over the pixels around a place, along one axis: bilinear where the picture grows; as wide as two pixels of the
// window where it shrinks, so that nothing aliases.
struct Taps {
    first: u32,
    count: u32,
    center: f32,
    reach: f32,
}

fn taps(place: u32, side: u32, scaled: u32) -> Taps {
    let ratio = f32(side) / f32(scaled);
    let reach = max(ratio, 1.0);
    let center = (f32(place) + 0.5) * ratio - 0.5;
    let count = min(u32(ceil(2.0 * reach)), side);
    let first = clamp(floor(center - reach) + 1.0, 0.0, f32(side - count));
    return Taps(u32(first), count, center, reach);
}

fn weight(tent: Taps, tap: u32) -> f32 {
    return max(1.0 - abs(f32(tap) - tent.center) / tent.reach, 0.0);
}

fn filtered(place: vec2<u32>, is_before: bool) -> vec3<f32> {
    let across = taps(place.x, window.size.x, window.area.z);
    let down = taps(place.y, window.size.y, window.area.w);
    var sum = vec4(0.0);
    for (var y = down.first; y < down.first + down.count; y++) {
        var row = vec4(0.0);
        for (var x = across.first; x < across.first + across.count; x++) {
            row += weight(across, x) * vec4(pixel(x, y, is_before), 1.0);
        }
        sum += weight(down, y) * row;
    }
    return sum.rgb / sum.w;
}

fn shown(place: vec2<u32>) -> vec3<f32> {
    for (var k = 0u; k < 3u; k++) {
        if place.x >= window.divider[k] && place.x < window.divider[k + 1u] {
            return window.stripes[k].rgb;
        }
    }
    let is_before = place.x < window.split;
    let factor = window.part.z;
    let seen = place + window.part.xy;
    let whole = select(window.area.z, window.size.x * factor, factor > 0u);
    let column = select(seen.x, whole - 1u - seen.x, window.mirror == 1u);
    var color: vec3<f32>;
    if factor > 0u {
        color = pixel(column / factor, seen.y / factor, is_before);
    } else if all(window.size == window.area.zw) {
        color = pixel(column, place.y, is_before);
    } else {
        color = filtered(vec2(column, place.y), is_before);
    }
    return select(color, vec3(dot(color, window.stale.rgb)), window.stale.w == 1.0);
}

fn light_of(code: vec3<f32>) -> vec3<f32> {
    return select(pow((code + 0.055) / 1.055, vec3(2.4)), code / 12.92, code <= vec3(0.04045));
}

// One triangle around all of the window.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(index % 2u) * 4.0 - 1.0, f32(index / 2u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn present(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    // Left of or above the area, this wraps around to beyond it.
    let place = vec2<u32>(at.xy) - window.area.xy;
    var color = window.background.rgb;
    if all(place < window.area.zw) {
        color = shown(place);
    }
    return vec4(select(color, light_of(color), window.background.w == 1.0), 1.0);
}

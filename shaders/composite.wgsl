// Pass composite: the blurred bins, front to back as disjoint coverage, become one picture of packed 8-bit sRGB.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<storage, read> blurred: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> result: array<u32>;
@group(0) @binding(5) var<storage, read> active_tiles: array<u32>;

// A pixel of a bin; nothing was written where nothing is.
fn bin_at(k: u32, pixel: vec2<u32>) -> vec4<f32> {
    if active_tiles[bins[k].active_at + tile_of(pixel, bins[k].size.x, result_tile())] == 0u {
        return vec4(0.0);
    }
    return unpacked(blurred[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x]);
}

// A bin at the scale of the picture.
fn sample_bin(k: u32, pixel: vec2<u32>) -> vec4<f32> {
    if bins[k].scale == 1u {
        return bin_at(k, pixel);
    }
    let limit = bins[k].size - 1u;
    let along = (vec2<f32>(pixel) + 0.5) / f32(bins[k].scale) - 0.5;
    let at = clamp(along, vec2(0.0), vec2<f32>(limit));
    let first = vec2<u32>(at);
    let second = min(first + 1u, limit);
    let share = at - vec2<f32>(first);
    return mix(mix(bin_at(k, first), bin_at(k, vec2(second.x, first.y)), share.x),
               mix(bin_at(k, vec2(first.x, second.y)), bin_at(k, second), share.x), share.y);
}

// Bins stacked front to back.
struct Stack {
    color: vec3<f32>,
    open: f32,              // how much nothing has covered yet
    hindmost: vec3<f32>,    // the colour of the hindmost bin that counts, and how far that is known
    known: f32,
}

// A bin behind all there is covers what is still open.
fn add(stack: Stack, layer: vec4<f32>) -> Stack {
    let taken = min(layer.a, stack.open);
    let own = layer.rgb * (1.0 / max(layer.a, 1.0e-6));
    let counts = min(layer.a * (1.0 / HINDMOST_COVERAGE), 1.0);
    return Stack(stack.color + own * taken, stack.open - taken,
                 mix(stack.hindmost, own, counts), mix(stack.known, 1.0, counts));
}

// What is still open was hidden from the camera, and lies behind all else: it gets the colour of the hindmost.
fn closed(stack: Stack) -> vec3<f32> {
    return stack.color + stack.hindmost * (stack.open / max(stack.known, 1.0e-6));
}

fn layers(pixel: vec2<u32>) -> vec3<f32> {
    var front = Stack(vec3(0.0), 1.0, vec3(0.0), 0.0);
    var back = front;
    for (var k = 0u; k < frame.near_bins; k++) {
        front = add(front, sample_bin(k, pixel));
    }
    for (var k = frame.near_bins; k < frame.bins; k++) {
        back = add(back, sample_bin(k, pixel));
    }
    if back.known > 1.0e-4 || front.known <= 0.0 {
        return front.color + front.open * closed(back);
    }
    // Where nothing lies behind, what lies in front is all there is.
    return closed(front);
}

fn chosen(pixel: vec2<u32>) -> vec3<f32> {
    let coc_px = scene_unpacked(scene[pixel.y * frame.size.x + pixel.x], frame.most_px).w;
    var color = vec3(0.0);
    for (var k = 0u; k < frame.bins; k++) {
        let share = share_at(bins[k].front, bins[k].behind, coc_px);
        if share > 0.0 {
            let layer = sample_bin(k, pixel);
            color += layer.rgb * (share / max(layer.a, 1.0e-6));
        }
    }
    return color;
}

fn code_of(light: f32) -> u32 {
    let x = clamp(light, 0.0, 1.0);
    let code = select(1.055 * pow(x, 1.0 / 2.4) - 0.055, x * 12.92, x <= 0.0031308);
    return u32(code * 255.0 + 0.5);
}

fn color_of(index: u32) -> vec3<u32> {
    let pixel = vec2(index % frame.size.x, index / frame.size.x);
    var color: vec3<f32>;
    if frame.compositing == 0u {
        color = layers(pixel);
    } else if frame.compositing == 1u {
        color = chosen(pixel);
    } else {
        color = unpacked(blurred[index]).rgb;
    }
    if frame.expansion > 0.0 {
        color *= frame.expansion / (frame.expansion + luminance(color));
    }
    return vec3(code_of(color.r), code_of(color.g), code_of(color.b));
}

// Four pixels, three words.
@compute @workgroup_size(LINE)
fn composite(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let quad = id.y * groups.x * LINE + id.x;
    let pixels = frame.size.x * frame.size.y;
    if 4u * quad >= pixels {
        return;
    }
    let last = pixels - 1u;
    let a = color_of(4u * quad);
    let b = color_of(min(4u * quad + 1u, last));
    let c = color_of(min(4u * quad + 2u, last));
    let d = color_of(min(4u * quad + 3u, last));
    result[3u * quad] = a.r | (a.g << 8u) | (a.b << 16u) | (b.r << 24u);
    result[3u * quad + 1u] = b.g | (b.b << 8u) | (c.r << 16u) | (c.g << 24u);
    result[3u * quad + 2u] = c.b | (d.r << 8u) | (d.g << 16u) | (d.b << 24u);
}

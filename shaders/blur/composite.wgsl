// Pass composite: combines the blurred bins, front to back as disjoint coverage, into packed 8-bit sRGB or YUYV.
// twin: src/bokeh/cpu/composite.rs

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<storage, read> blurred: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> result: array<u32>;
@group(0) @binding(5) var<storage, read> active_tiles: array<u32>;
@group(0) @binding(6) var<storage, read> shown: array<u32>;
@group(0) @binding(7) var<storage, read> dilated: array<vec4<f32>>;

var<workgroup> codes: array<u32, WORKGROUP_1D>;

// A pixel of a bin; tiles without content were not written.
fn load_bin_pixel(k: u32, pixel: vec2<u32>) -> vec4<f32> {
    if active_tiles[HEAD + bins[k].active_at + tile_index(pixel, bins[k].size.x, result_tile())] == 0u {
        return vec4(0.0);
    }
    return unpack_half4(blurred[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x]);
}

// A bin at the picture's scale, bilinear.
fn sample_bin(k: u32, pixel: vec2<u32>) -> vec4<f32> {
    if bins[k].scale == 1u {
        return load_bin_pixel(k, pixel);
    }
    let limit = bins[k].size - 1u;
    let along = (vec2<f32>(pixel) + 0.5) * (1.0 / f32(bins[k].scale)) - 0.5;
    let at = clamp(along, vec2(0.0), vec2<f32>(limit));
    let first = vec2<u32>(at);
    let second = min(first + 1u, limit);
    let fraction = at - vec2<f32>(first);
    return mix(mix(load_bin_pixel(k, first), load_bin_pixel(k, vec2(second.x, first.y)), fraction.x),
               mix(load_bin_pixel(k, vec2(first.x, second.y)), load_bin_pixel(k, second), fraction.x), fraction.y);
}

fn select_by_coc(pixel: vec2<u32>) -> vec3<f32> {
    let coc_px = unpack_scene(scene[pixel.y * frame.size.x + pixel.x], frame.max_px).w;
    var color = vec3(0.0);
    for (var k = 0u; k < frame.bins; k++) {
        let weight = bin_weight(bins[k].front, bins[k].behind, coc_px);
        if weight > 0.0 {
            let layer = sample_bin(k, pixel);
            color += layer.rgb * (weight / max(layer.a, 1.0e-6));
        }
    }
    return color;
}

fn encode_srgb(light: f32) -> u32 {
    let x = clamp(light, 0.0, 1.0);
    let code = select(1.055 * pow(x, 1.0 / 2.4) - 0.055, x * 12.92, x <= 0.0031308);
    return u32(code * 255.0 + 0.5);
}

// Packed sRGB: red in the lowest byte, then green and blue.
fn encode_pixel(index: u32) -> u32 {
    let pixel = vec2(index % frame.size.x, index / frame.size.x);
    var color: vec3<f32>;
    if frame.compositing == 0u {
        color = composite_layers(pixel);
    } else if frame.compositing == 1u {
        color = select_by_coc(pixel);
    } else {
        color = unpack_half4(blurred[index]).rgb;
    }
    if frame.expansion > 0.0 {
        color *= frame.expansion / (frame.expansion + luminance(color));
    }
    return encode_srgb(color.r) | (encode_srgb(color.g) << 8u) | (encode_srgb(color.b) << 16u);
}

// One pixel per thread; four pixels are packed to three words, or two to one word of YUYV.
@compute @workgroup_size(WORKGROUP_1D)
fn composite(@builtin(workgroup_id) line: vec3<u32>, @builtin(num_workgroups) lines: vec3<u32>,
             @builtin(local_invocation_index) thread: u32) {
    let first = (line.y * lines.x + line.x) * WORKGROUP_1D;
    let pixels = frame.size.x * frame.size.y;
    if first + thread < pixels {
        codes[thread] = encode_pixel(first + thread);
    }
    workgroupBarrier();
    if frame.yuyv == 1u {
        if 2u * thread < WORKGROUP_1D && first + 2u * thread < pixels {
            result[first / 2u + thread] = pack_yuyv(codes[2u * thread], codes[2u * thread + 1u]);
        }
        return;
    }
    // A word has the last bytes of a pixel, without its first `word % 3`, and the first bytes of the next.
    let word = 3u * first / 4u + thread;
    let pixel = 4u * (thread / 3u) + thread % 3u;
    if 4u * thread < 3u * WORKGROUP_1D && word < (pixels + 3u) / 4u * 3u {
        let part = thread % 3u;
        result[word] = (codes[pixel] >> (8u * part)) | (codes[pixel + 1u] << (24u - 8u * part));
    }
}

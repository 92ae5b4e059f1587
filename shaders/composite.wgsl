// Pass composite: combines the blurred bins, front to back as disjoint coverage, into packed 8-bit sRGB or YUYV.
// twin: src/bokeh/cpu/composite.rs

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<storage, read> blurred: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> result: array<u32>;
@group(0) @binding(5) var<storage, read> active_tiles: array<u32>;
@group(0) @binding(6) var<storage, read> shown: array<u32>;
@group(0) @binding(7) var<storage, read> reached: array<vec4<f32>>;

var<workgroup> codes: array<u32, LINE>;

// A pixel of a bin; tiles without content were not written.
fn bin_at(k: u32, pixel: vec2<u32>) -> vec4<f32> {
    if active_tiles[HEAD + bins[k].active_at + tile_of(pixel, bins[k].size.x, result_tile())] == 0u {
        return vec4(0.0);
    }
    return unpacked(blurred[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x]);
}

// A bin at the picture's scale, bilinear.
fn sample_bin(k: u32, pixel: vec2<u32>) -> vec4<f32> {
    if bins[k].scale == 1u {
        return bin_at(k, pixel);
    }
    let limit = bins[k].size - 1u;
    let along = (vec2<f32>(pixel) + 0.5) * (1.0 / f32(bins[k].scale)) - 0.5;
    let at = clamp(along, vec2(0.0), vec2<f32>(limit));
    let first = vec2<u32>(at);
    let second = min(first + 1u, limit);
    let fraction = at - vec2<f32>(first);
    return mix(mix(bin_at(k, first), bin_at(k, vec2(second.x, first.y)), fraction.x),
               mix(bin_at(k, vec2(first.x, second.y)), bin_at(k, second), fraction.x), fraction.y);
}

fn selected_color(pixel: vec2<u32>) -> vec3<f32> {
    let coc_px = scene_unpacked(scene[pixel.y * frame.size.x + pixel.x], frame.max_px).w;
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

fn code_of(light: f32) -> u32 {
    let x = clamp(light, 0.0, 1.0);
    let code = select(1.055 * pow(x, 1.0 / 2.4) - 0.055, x * 12.92, x <= 0.0031308);
    return u32(code * 255.0 + 0.5);
}

// Packed sRGB: red in the lowest byte, then green and blue.
fn codes_of(index: u32) -> u32 {
    let pixel = vec2(index % frame.size.x, index / frame.size.x);
    var color: vec3<f32>;
    if frame.compositing == 0u {
        color = layers(pixel);
    } else if frame.compositing == 1u {
        color = selected_color(pixel);
    } else {
        color = unpacked(blurred[index]).rgb;
    }
    if frame.expansion > 0.0 {
        color *= frame.expansion / (frame.expansion + luminance(color));
    }
    return code_of(color.r) | (code_of(color.g) << 8u) | (code_of(color.b) << 16u);
}

// One pixel per thread; four pixels are packed to three words, or two to one word of YUYV.
@compute @workgroup_size(LINE)
fn composite(@builtin(workgroup_id) line: vec3<u32>, @builtin(num_workgroups) lines: vec3<u32>,
             @builtin(local_invocation_index) thread: u32) {
    let first = (line.y * lines.x + line.x) * LINE;
    let pixels = frame.size.x * frame.size.y;
    if first + thread < pixels {
        codes[thread] = codes_of(first + thread);
    }
    workgroupBarrier();
    if frame.yuyv == 1u {
        if 2u * thread < LINE && first + 2u * thread < pixels {
            result[first / 2u + thread] = yuyv_of(codes[2u * thread], codes[2u * thread + 1u]);
        }
        return;
    }
    // A word has the last bytes of a pixel, without its first `word % 3`, and the first bytes of the next.
    let word = 3u * first / 4u + thread;
    let pixel = 4u * (thread / 3u) + thread % 3u;
    if 4u * thread < 3u * LINE && word < (pixels + 3u) / 4u * 3u {
        let part = thread % 3u;
        result[word] = (codes[pixel] >> (8u * part)) | (codes[pixel + 1u] << (24u - 8u * part));
    }
}

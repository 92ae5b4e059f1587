// Pass matte_mix: writes the mixed pixels, row by row, as `MixedPixel` in Rust, with the near colour minus the far
// colour: the most likely pair that adds up to the pixel's own colour (Chuang et al. 2001, equation 9, without the
// noise term).
// twin: `color_difference` in src/depth/matting/contrast.rs

@group(0) @binding(1) var<uniform> lights: array<vec4<f32>, 256>;
@group(0) @binding(2) var<storage, read> rgb: array<u32>;
@group(0) @binding(3) var<storage, read> background: array<u32>;
@group(0) @binding(4) var<storage, read> words: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> counts: array<u32>;
@group(0) @binding(6) var<storage, read> colors: array<Color>;
@group(0) @binding(7) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(8) var<storage, read_write> mixed: array<vec4<u32>>;

// Bits of an infinite distance.
const INFINITE = 0x7f800000u;

fn color_difference(near: Color, far: Color, own: vec3<f32>, alpha: f32) -> vec3<f32> {
    let rest = 1.0 - alpha;
    let of_both = vec2(alpha * alpha, rest * rest);
    let spread = Symmetric(of_both.x * near.row + of_both.y * far.row, of_both.x * near.rest + of_both.y * far.rest);
    let step = multiply(invert(regularize(spread, 1.0)), own - alpha * near.mean - rest * far.mean);
    let of_near = multiply(Symmetric(near.row, near.rest), step);
    let of_far = multiply(Symmetric(far.row, far.rest), step);
    let difference = near.mean + alpha * of_near - far.mean - rest * of_far;
    // Clamped so that neither colour is darker than black or brighter than white.
    let up = max(rest, 1e-3);
    let down = max(alpha, 1e-3);
    let most = min((1.0 - own) / up, own / down);
    let least = -min(own / up, (1.0 - own) / down);
    return min(max(difference, min(least, vec3(0.0))), max(most, vec3(0.0)));
}

fn inverse_to_metres(inverse: f32) -> u32 {
    return select(INFINITE, bitcast<u32>(1.0 / max(inverse, TINY)), inverse > 0.0);
}

@compute @workgroup_size(64)
fn matte_mix(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var k = id.x; k < counts[NEXT]; k += 64u * groups.x) {
        let flags = atomicLoad(&entries[k].flags);
        if (flags & MIXED) == 0u {
            continue;
        }
        let at = entries[k].at;
        let alpha = entries[k].alpha;
        var far = colors[2u * entries[k].model + 1u];
        let has_background = (flags & KNOWN_BACKGROUND) != 0u;
        if has_background {
            far.mean = background_light(at);
        }
        let difference = color_difference(colors[2u * entries[k].model], far, light_at(at), alpha);
        let word = at / frame.size.x * words_across() + at % frame.size.x / WORD;
        let before = countOneBits(words[word].x & ((1u << (at % frame.size.x % WORD)) - 1u));
        let place = counts[TOTALS + word / BLOCK] + words[word].y + before;
        let known_fraction = select(1.0 - alpha, 1.0, has_background);
        mixed[2u * place + 2u] =
            vec4(at, inverse_to_metres(entries[k].near), inverse_to_metres(entries[k].far), bitcast<u32>(alpha));
        mixed[2u * place + 3u] = bitcast<vec4<u32>>(vec4(known_fraction, difference));
    }
}

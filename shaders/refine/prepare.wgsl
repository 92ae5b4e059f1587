// Pass refine_prepare: resamples the depth map to the picture's size and flags unknown pixels; packs the picture, a
// word per pixel. Clears the claims.
// twin: src/depth/refine/upsample.rs

@group(0) @binding(1) var<storage, read> map: array<u32>;               // bits of metres
@group(0) @binding(2) var<storage, read> taps: array<vec2<u32>>;        // of columns, then of rows: the first of two
                                                                        // samples, and the bits of the second one's
                                                                        // weight
@group(0) @binding(3) var<storage, read> rgb: array<u32>;               // bytes
@group(0) @binding(4) var<storage, read_write> colors: array<u32>;
@group(0) @binding(5) var<storage, read_write> flags: array<u32>;
@group(0) @binding(6) var<storage, read_write> metres: array<f32>;
@group(0) @binding(7) var<storage, read_write> row_claims: array<f32>;
@group(0) @binding(8) var<storage, read_write> column_claims: array<f32>;

fn is_known(bits: vec4<u32>) -> vec4<bool> {
    return (bits >= vec4(MIN_BITS)) & (bits <= vec4(MAX_BITS));
}

// Returns the depth at a pixel, or 0.
fn resample_depth(pixel: vec2<u32>) -> f32 {
    let column = taps[pixel.x];
    let row = taps[frame.size.x + pixel.y];
    let first = vec2(column.x, row.x);
    let second = min(first + 1u, frame.map_size - 1u);
    let rows = vec2(first.y, second.y) * frame.map_size.x;
    let four = vec4(map[rows.x + first.x], map[rows.x + second.x], map[rows.y + first.x], map[rows.y + second.x]);
    let fraction = bitcast<vec2<f32>>(vec2(column.y, row.y));
    let nearest = four[select(0u, 1u, fraction.x >= 0.5) + select(0u, 2u, fraction.y >= 0.5)];
    let nearest_m = select(0.0, bitcast<f32>(nearest), is_known(vec4(nearest)).x);
    if !all(is_known(four)) || all(fraction == vec2(0.0)) {
        return nearest_m;
    }
    let inverse = 1.0 / bitcast<vec4<f32>>(four);
    let low = min(min(inverse.x, inverse.y), min(inverse.z, inverse.w));
    let high = max(max(inverse.x, inverse.y), max(inverse.z, inverse.w));
    if high - low > MAP_SURFACE * high {
        return nearest_m;
    }
    let lines = inverse.xz + (inverse.yw - inverse.xz) * fraction.x;
    return 1.0 / (lines.x + (lines.y - lines.x) * fraction.y);
}

fn pack_color(k: u32) -> u32 {
    let at = 3u * k;
    let shift = 8u * (at % 4u);
    // The rest of the pixel is in the next word; the last pixel of the picture may end with the last word.
    let next = rgb[min(at / 4u + 1u, arrayLength(&rgb) - 1u)];
    return ((rgb[at / 4u] >> shift) | select(next << (32u - shift), 0u, shift == 0u)) & 0xffffffu;
}

@compute @workgroup_size(16, 16)
fn refine_prepare(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let k = id.y * frame.size.x + id.x;
    colors[k] = pack_color(k);
    let depth_m = resample_depth(id.xy);
    metres[k] = depth_m;
    flags[k] = select(0u, UNKNOWN | HOLE, depth_m == 0.0);
    row_claims[k] = 0.0;
    column_claims[k] = 0.0;
}

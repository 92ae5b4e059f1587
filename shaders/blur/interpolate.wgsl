// Pass interpolate: replaces the colours of bins that are decimated by those between the middles of their cells. Coverage,
// which shows no more than outlines, stays as it is.
// twin: src/bokeh/cpu/decimate.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<storage, read> grid: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> means: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> source: array<vec2<u32>>;

fn work_size(k: u32) -> vec2<u32> {
    return select(vec2(0u), bins[k].size, bins[k].decimation > 1u);
}

fn load_mean(k: u32, cell: vec2<u32>) -> vec4<f32> {
    return unpack_half4(means[mean_index(k, cell)]);
}

// What a neighbour adds to the sharpened colour of a cell; outside the bin there are none.
fn neighbour_share(k: u32, own: vec4<f32>, cell: vec2<u32>) -> vec3<f32> {
    if any(cell >= means_size(k)) {
        return vec3(0.0);
    }
    let other = load_mean(k, cell);
    return CELL_SHARPNESS * other.a * (own.rgb - other.rgb);
}

// Sharpened colour of a cell times its weight, and its weight.
fn sharpen(k: u32, cell: vec2<u32>) -> vec4<f32> {
    let own = load_mean(k, cell);
    // A column or row before the first one wraps around, and lies beyond the last one.
    let shares = neighbour_share(k, own, cell - vec2(1u, 0u)) + neighbour_share(k, own, cell + vec2(1u, 0u))
        + neighbour_share(k, own, cell - vec2(0u, 1u)) + neighbour_share(k, own, cell + vec2(0u, 1u));
    return vec4((own.rgb + shares) * own.a, own.a);
}

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn interpolate(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
               @builtin(local_invocation_id) local: vec3<u32>) {
    let place = find_tile(workgroup, workgroups, vec2(SMALL_TILE));
    let k = place.bin;
    let pixel = place.tile * SMALL_TILE + local.xy;
    if !place.some || any(pixel >= work_size(k)) || !is_covered(k, pixel) {
        return;
    }
    let last = means_size(k) - 1u;
    let at = clamp((vec2<f32>(2u * pixel + 1u) / f32(bins[k].decimation) - 1.0) * 0.5, vec2(0.0), vec2<f32>(last));
    let first = vec2<u32>(at);
    let second = min(first + 1u, last);
    let above = mix(sharpen(k, first), sharpen(k, vec2(second.x, first.y)), fract(at.x));
    let below = mix(sharpen(k, vec2(first.x, second.y)), sharpen(k, second), fract(at.x));
    let mean = mix(above, below, fract(at.y));
    let index = bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x;
    let coverage = unpack_half4(source[index]).a;
    source[index] = pack_half4(vec4(mean.rgb * (coverage / max(mean.a, MIN_WEIGHT)), coverage));
}

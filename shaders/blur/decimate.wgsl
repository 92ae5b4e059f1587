// Pass decimate: averages the colours of bins over larger cells, with tents: what a cell has averaged no filter can bring
// back. Only for bins that are decimated.
// twin: src/bokeh/cpu/decimate.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<storage, read> grid: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> source: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> means: array<vec2<u32>>;

fn work_size(k: u32) -> vec2<u32> {
    return select(vec2(0u), means_size(k), bins[k].decimation > 1u);
}

// Weight of tap `j` of a tent, and the number of taps: an odd number of pixels has one in the middle.
fn tent_weight(side: u32, j: u32) -> f32 {
    let to_middle = 0.5 * abs(f32(2 * i32(j) + 1 - i32(tent_taps(side))));
    return (f32(side) - to_middle) / f32(side * side);
}

fn tent_taps(side: u32) -> u32 {
    return 2u * side - side % 2u;
}

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn decimate(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
            @builtin(local_invocation_id) local: vec3<u32>) {
    let place = find_tile(workgroup, workgroups, vec2(SMALL_TILE));
    let k = place.bin;
    let cell = place.tile * SMALL_TILE + local.xy;
    if !place.some || any(cell >= work_size(k)) {
        return;
    }
    let side = bins[k].decimation;
    let first = vec2<i32>(cell * side) - i32(side / 2u);
    var sum = vec4(0.0);
    for (var j = 0u; j < tent_taps(side); j++) {
        for (var i = 0u; i < tent_taps(side); i++) {
            let pixel = vec2<u32>(clamp(first + vec2<i32>(vec2(i, j)), vec2(0), vec2<i32>(bins[k].size) - 1));
            if is_covered(k, pixel) {
                let value = unpack_half4(source[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x]);
                sum += tent_weight(side, i) * tent_weight(side, j) * value;
            }
        }
    }
    means[mean_index(k, cell)] = pack_half4(vec4(sum.rgb / max(sum.a, MIN_WEIGHT), sum.a));
}

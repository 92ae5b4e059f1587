// Included by the pass with `LANES` threads per pixel: reductions over them.

const LANES = 16u;

// Sums of each thread for its pixel, and its smallest and largest depths.
var<workgroup> sums: array<vec4<f32>, PIXELS * LANES>;
var<workgroup> ends: array<vec2<f32>, PIXELS * LANES>;

// Adds halves to halves, in the order of the CPU's vector code.
fn sum_lanes(first: u32) -> vec4<f32> {
    var four: array<vec4<f32>, 4>;
    for (var n = 0u; n < 4u; n++) {
        four[n] = (sums[first + n] + sums[first + n + 8u]) + (sums[first + n + 4u] + sums[first + n + 12u]);
    }
    return (four[0] + four[2]) + (four[1] + four[3]);
}

fn min_max_lanes(first: u32) -> vec2<f32> {
    var both = ends[first];
    for (var n = 1u; n < LANES; n++) {
        let other = ends[first + n];
        both = vec2(min(both.x, other.x), max(both.y, other.y));
    }
    return both;
}

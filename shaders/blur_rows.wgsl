// Pass blur_rows: the horizontal low-rank filters of some bins, four terms at a time.
// Reads premultiplied colour and coverage; writes one such picture per term.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> node_reach: array<u32>;
@group(0) @binding(5) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> scene: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> rows: array<vec4<f32>>;

const TILE = vec2(64u, 4u);

fn extent_of(k: u32) -> vec2<u32> {
    return bins[k].size;
}

fn coc_at(index: u32) -> f32 {
    return scene[index].w;
}

@compute @workgroup_size(64, 4)
fn blur_rows(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
             @builtin(local_invocation_id) local: vec3<u32>) {
    let place = place_of(workgroup, workgroups, TILE);
    let k = place.bin;
    let pixel = place.tile * TILE + local.xy;
    if !place.some || any(pixel >= bins[k].size) {
        return;
    }
    let corner = corner_of(k, pixel);
    let taps = taps_at(k, pixel, corner);
    let line = bins[k].pixels_at + pixel.y * bins[k].size.x;
    var sum0 = vec4(0.0);
    var sum1 = vec4(0.0);
    var sum2 = vec4(0.0);
    var sum3 = vec4(0.0);
    for (var j = -taps.reach; j <= taps.reach; j++) {
        let weight = tap_at(taps, corner.along, j);
        let x = clamp(i32(pixel.x) + j, 0, i32(bins[k].size.x) - 1);
        let value = source[line + u32(x)];
        sum0 += weight.x * value;
        sum1 += weight.y * value;
        sum2 += weight.z * value;
        sum3 += weight.w * value;
    }
    let at = bins[k].rows_at + pixel.y * bins[k].size.x + pixel.x;
    rows[at] = sum0;
    if work.terms > 1u { rows[at + bins[k].rows_apart] = sum1; }
    if work.terms > 2u { rows[at + 2u * bins[k].rows_apart] = sum2; }
    if work.terms > 3u { rows[at + 3u * bins[k].rows_apart] = sum3; }
}

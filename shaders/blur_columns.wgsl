// Pass blur_columns: the vertical low-rank filters, terms summed; truncation leaves lobes, so the result is kept in
// the range of the colours in reach.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> node_reach: array<u32>;
@group(0) @binding(5) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> scene: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> rows: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> blurred: array<vec4<f32>>;

const TILE = vec2(64u, 4u);

fn extent_of(k: u32) -> vec2<u32> {
    return bins[k].size;
}

fn coc_at(index: u32) -> f32 {
    return scene[index].w;
}

@compute @workgroup_size(64, 4)
fn blur_columns(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                @builtin(local_invocation_id) local: vec3<u32>) {
    let place = place_of(workgroup, workgroups, TILE);
    let k = place.bin;
    let pixel = place.tile * TILE + local.xy;
    if !place.some || any(pixel >= bins[k].size) {
        return;
    }
    let corner = corner_of(k, pixel);
    let taps = taps_at(k, pixel, corner);
    let apart = bins[k].rows_apart;
    var sum = vec4(0.0);
    for (var j = -taps.reach; j <= taps.reach; j++) {
        let weight = tap_at(taps, corner.along, j);
        let y = clamp(i32(pixel.y) + j, 0, i32(bins[k].size.y) - 1);
        let at = bins[k].rows_at + u32(y) * bins[k].size.x + pixel.x;
        sum += weight.x * rows[at];
        if work.terms > 1u { sum += weight.y * rows[apart + at]; }
        if work.terms > 2u { sum += weight.z * rows[2u * apart + at]; }
        if work.terms > 3u { sum += weight.w * rows[3u * apart + at]; }
    }
    let at = bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x;
    if work.group > 0u {
        sum += blurred[at];
    }
    if work.last == 1u && frame.compositing != 2u {
        let low = mix(edge_at(corner, 0u), edge_at(corner, 2u), corner.along).yzw;
        let high = mix(edge_at(corner, 1u), edge_at(corner, 3u), corner.along).xyz;
        sum.a = clamp(sum.a, 0.0, 1.0);
        sum = vec4(min(max(sum.rgb, low * sum.a), high * sum.a), sum.a);
    }
    blurred[at] = sum;
}

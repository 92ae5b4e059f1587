// Pass bin: a bin's share of each pixel, premultiplied and averaged down to the bin's scale.
// Reads the scene; writes premultiplied r, g, b, coverage, and coverage times |CoC|.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bin_info: Bin;
@group(0) @binding(2) var<storage, read> scene: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> source: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> weighted_coc: array<f32>;

fn tent(k: u32, scale: u32) -> f32 {
    let s = f32(scale);
    return select((1.0 - abs((f32(k) + 0.5) / s - 1.0)) / s, 1.0, scale == 1u);
}

@compute @workgroup_size(16, 16)
fn bin(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= bin_info.size) {
        return;
    }
    var sum = vec4(0.0);
    var coc_sum = 0.0;
    // A tent of twice the scale, so that reducing a picture keeps its centroid.
    let scale = bin_info.scale;
    let taps = select(2u * scale, 1u, scale == 1u);
    let before = select(scale / 2u, 0u, scale == 1u);
    for (var j = 0u; j < taps; j++) {
        let y = clamp(i32(id.y * scale + j) - i32(before), 0, i32(frame.size.y) - 1);
        for (var i = 0u; i < taps; i++) {
            let x = clamp(i32(id.x * scale + i) - i32(before), 0, i32(frame.size.x) - 1);
            let value = scene[u32(y) * frame.size.x + u32(x)];
            let share = select(share_at(bin_info.front, bin_info.behind, value.w), 1.0, bin_info.whole == 1u);
            let weight = share * tent(i, scale) * tent(j, scale);
            sum += vec4(value.rgb, 1.0) * weight;
            coc_sum += weight * abs(value.w);
        }
    }
    let index = id.y * bin_info.size.x + id.x;
    source[index] = sum;
    weighted_coc[index] = coc_sum;
}

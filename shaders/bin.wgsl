// Pass bin: a bin's share of each pixel, premultiplied and averaged down to the bin's scale.
// Reads the scene; writes premultiplied r, g, b, coverage, and coverage times |CoC|.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bin_info: Bin;
@group(0) @binding(2) var<storage, read> scene: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> source: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> weighted_coc: array<f32>;

@compute @workgroup_size(16, 16)
fn bin(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= bin_info.size) {
        return;
    }
    var sum = vec4(0.0);
    var coc_sum = 0.0;
    for (var sub = 0u; sub < bin_info.scale * bin_info.scale; sub++) {
        let at = id.xy * bin_info.scale + vec2(sub % bin_info.scale, sub / bin_info.scale);
        let pixel = min(at, frame.size - 1u);
        let value = scene[pixel.y * frame.size.x + pixel.x];
        let share = select(share_at(bin_info.front, bin_info.behind, value.w), 1.0, bin_info.whole == 1u);
        sum += vec4(value.rgb, 1.0) * share;
        coc_sum += share * abs(value.w);
    }
    let scale = 1.0 / f32(bin_info.scale * bin_info.scale);
    let index = id.y * bin_info.size.x + id.x;
    source[index] = sum * scale;
    weighted_coc[index] = coc_sum * scale;
}

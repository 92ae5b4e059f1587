// Pass refine_smooth: the sigma filter (Lee 1983) on inverse depth, first along rows from metres, then down columns.
// twin: src/depth/refine/smooth.rs

@group(0) @binding(1) var<storage, read> measures: array<f32>;
@group(0) @binding(2) var<storage, read> map: array<f32>;
@group(0) @binding(3) var<storage, read_write> smoothed: array<f32>;

fn inverse_at(k: u32) -> f32 {
    return select(frame.focus_m / map[k], map[k], DOWN == 1u);
}

@compute @workgroup_size(64, 4)
fn refine_smooth(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let k = id.y * frame.size.x + id.x;
    let step = select(1u, frame.size.x, DOWN == 1u);
    let here = inverse_at(k);
    let limit = measures[SURFACE];
    var sum = 0.0;
    for (var n = 1u; n <= PAIRS; n++) {
        let apart = n * PAIR_STEP_PX;
        if id[DOWN] >= apart && id[DOWN] + apart < frame.size[DOWN] {
            let before = inverse_at(k - apart * step) - here;
            let after = inverse_at(k + apart * step) - here;
            sum += select(0.0, before + after, abs(before) < limit && abs(after) < limit);
        }
    }
    smoothed[k] = here + sum * (1.0 / f32(2u * PAIRS + 1u));
}

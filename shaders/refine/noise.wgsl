// Pass refine_noise, in one workgroup: the noise of the map, from a low quantile of second differences; first of depths
// in metres, then of inverse depths. Derives the thresholds for surfaces and edges.
// twin: src/depth/refine/noise.rs

@group(0) @binding(1) var<storage, read> flags: array<u32>;
@group(0) @binding(2) var<storage, read> map: array<f32>;
@group(0) @binding(3) var<storage, read_write> samples: array<u32>;
@group(0) @binding(4) var<storage, read_write> measures: array<f32>;

fn inverse_at(k: u32) -> f32 {
    return select(frame.focus_m / map[k], map[k], DOWN == 1u);
}

@compute @workgroup_size(THREADS)
fn refine_noise(@builtin(local_invocation_index) thread: u32) {
    let step = max((frame.size + NOISE_GRID - 1u) / NOISE_GRID, vec2(1u));
    let across = (max(frame.size.x, 2u * LAG_PX) - 2u * LAG_PX + step.x - 1u) / step.x;
    let length = across * ((frame.size.y + step.y - 1u) / step.y);
    for (var n = thread; n < length; n += THREADS) {
        let k = n / across * step.y * frame.size.x + LAG_PX + n % across * step.x;
        let is_unknown = (flags[k - LAG_PX] | flags[k] | flags[k + LAG_PX]) & UNKNOWN;
        let difference = abs(inverse_at(k - LAG_PX) - 2.0 * inverse_at(k) + inverse_at(k + LAG_PX));
        samples[n] = select(NONE, bitcast<u32>(difference), is_unknown == 0u);
    }
    let count = count_below(NONE, length, thread);
    let quantile = bitcast<f32>(select_rank(u32(f32(count) * SMOOTH_FRACTION), length, thread));
    // The second difference has 1 + 4 + 1 times the variance of a depth.
    let noise = select(0.0, quantile / SMOOTH_QUANTILE / sqrt(6.0), count > 0u);
    if thread == 0u {
        if DOWN == 0u {
            measures[SURFACE] = select(SURFACE_SIGMAS * noise, 0.0, noise < NO_NOISE);
            measures[STILL] = max(MIN_CHANGE, CHANGE_SIGMAS * noise);
        } else {
            measures[STEP] = max(MIN_DEPTH_STEP, DEPTH_STEP_SIGMAS * noise);
        }
    }
}

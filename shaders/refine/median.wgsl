// Pass refine_median, in one workgroup: the median colour change over a grid of samples, and from it the largest change
// of a static pixel.
// twin: `median_change` in src/depth/refine/temporal.rs

@group(0) @binding(1) var<storage, read> change: array<u32>;
@group(0) @binding(2) var<storage, read_write> samples: array<u32>;
@group(0) @binding(3) var<storage, read_write> measures: array<f32>;

@compute @workgroup_size(THREADS)
fn refine_median(@builtin(local_invocation_index) thread: u32) {
    let step = (frame.size + CHANGE_GRID - 1u) / CHANGE_GRID;
    let grid = (frame.size + step - 1u) / step;
    let length = grid.x * grid.y;
    for (var n = thread; n < length; n += THREADS) {
        samples[n] = change[n / grid.x * step.y * frame.size.x + n % grid.x * step.x];
    }
    let median = f32(select_rank(length / 2u, length, thread)) / 9.0;
    if thread == 0u {
        measures[CHANGED] = clamp(MOVED * median, MOVED_MIN, MOVED_MAX);
    }
}

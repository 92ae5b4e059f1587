// Pass refine_median, in one workgroup: the median change of colour, over a grid of samples, and with it the change up to
// which a pixel rests.

@group(0) @binding(1) var<storage, read> change: array<u32>;
@group(0) @binding(2) var<storage, read_write> samples: array<u32>;
@group(0) @binding(3) var<storage, read_write> measures: array<f32>;

@compute @workgroup_size(THREADS)
fn refine_median(@builtin(local_invocation_index) thread: u32) {
    let step = (frame.size + CHANGE_LOOKS - 1u) / CHANGE_LOOKS;
    let looks = (frame.size + step - 1u) / step;
    let length = looks.x * looks.y;
    for (var n = thread; n < length; n += THREADS) {
        samples[n] = change[n / looks.x * step.y * frame.size.x + n % looks.x * step.x];
    }
    let median = f32(sample_of_rank(length / 2u, length, thread)) / 9.0;
    if thread == 0u {
        measures[CHANGED] = clamp(MOVED * median, MOVED_LEAST, MOVED_MOST);
    }
}

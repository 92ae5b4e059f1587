// Pass refine_steady: snaps pixels between two surfaces to the one with the more similar colour; then the temporal
// filter moves the mean of each pixel towards its inverse depth, and outputs it in metres.
// twin: `snap_to_surfaces` in src/depth/refine/align.rs, `UpdateMean` in src/depth/refine/temporal.rs

struct Remembered {
    mean: f32,      // filtered inverse depth
    count: f32,     // number of frames in it
    held: u32,      // frames for which a step was held back
}

@group(0) @binding(1) var<storage, read> measures: array<f32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read> inverse: array<f32>;
@group(0) @binding(4) var<storage, read> colors: array<u32>;
@group(0) @binding(5) var<storage, read> change: array<u32>;
@group(0) @binding(6) var<storage, read_write> memory: array<Remembered>;
@group(0) @binding(7) var<storage, read_write> before: array<u32>;
@group(0) @binding(8) var<storage, read_write> metres: array<f32>;

// Whether a depth lies between those at both ends of a pair.
fn is_between(here: f32, a: u32, b: u32) -> bool {
    let low = min(inverse[a], inverse[b]);
    let high = max(inverse[a], inverse[b]);
    let depth_step = measures[STEP];
    return here - low > depth_step_at(depth_step, here) && high - here > depth_step_at(depth_step, high);
}

// Returns the depth of a processed pixel. Its neighbours are those after the votes, whatever they become here.
fn snap_to_surface(pixel: vec2<u32>, k: u32) -> f32 {
    let here = inverse[k];
    for (var n = 0u; n < 2u; n++) {
        let axis = 1u - n;
        let step = select(1u, frame.size.x, axis == 1u);
        if pixel[axis] > 0u && pixel[axis] + 1u < frame.size[axis] && is_between(here, k - step, k + step) {
            let own = unpack_color(colors[k]);
            let a = unpack_color(colors[k - step]) - own;
            let b = unpack_color(colors[k + step]) - own;
            return inverse[select(k + step, k - step, dot(a, a) <= dot(b, b))];
        }
    }
    return here;
}

fn update_mean(now: f32, old: Remembered, changed: f32) -> Remembered {
    // Weight of the past: 1 up to the bound, falling to 0 at twice the bound.
    let past_weight = saturate(2.0 - changed / 9.0 / measures[CHANGED]);
    let step = now - old.mean;
    let noise_ratio = saturate(abs(step) / measures[STILL]);
    if abs(step) > 2.0 * measures[STEP] && past_weight >= 1.0 && old.held < HOLD_FRAMES {
        return Remembered(old.mean, old.count, old.held + 1u);
    }
    let frames = old.count * past_weight;
    // The closer to the limit, the less likely it is noise: the weight of the new depth grows smoothly to 1 there.
    let squared = noise_ratio * noise_ratio;
    let alpha = 1.0 / (frames + 1.0);
    let count = select(min(frames + 1.0, MAX_FRAMES), 1.0, noise_ratio >= 1.0);
    return Remembered(old.mean + (alpha + (1.0 - alpha) * squared * squared) * step, count, 0u);
}

@compute @workgroup_size(64, 4)
fn refine_steady(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let k = id.y * frame.size.x + id.x;
    var now = inverse[k];
    if (flags[k] & PROCESSED) != 0u {
        now = snap_to_surface(id.xy, k);
    }
    var next = Remembered(now, 1.0, 0u);
    if frame.is_fresh == 0u {
        var old = memory[k];
        old.mean *= frame.rescale;
        next = update_mean(now, old, f32(change[k]));
    }
    memory[k] = next;
    before[k] = colors[k];
    metres[k] = frame.focus_m / next.mean;
}

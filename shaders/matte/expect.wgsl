// Pass matte_expect: an iteration of expectation maximisation over the entries at edges, 64 workgroups: re-estimates
// the probabilities of a mixed pixel and of a wrong map from the previous ones.
// twin: `Prior::estimate` in src/depth/matting/alpha.rs

@group(0) @binding(1) var<uniform> run: PassRun;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(4) var<storage, read_write> partials: array<vec4<f32>>;

@compute @workgroup_size(LANES)
fn matte_expect(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let prior = prior_after(run.index, thread);
    let weights = mixture_weights(prior);
    var own = vec4(0.0);
    for (var k = group.x * LANES + thread; k < min(counts[EDGES], frame.max_entries); k += LANES * LANES) {
        let labels = atomicLoad(&entries[k].flags);
        if (labels & LONE) != 0u {
            continue;
        }
        let sided = weights.y * entries[k].sided.x;
        let wrong = weights.z * entries[k].any_alpha.x;
        let total = weights.x * entries[k].pure + sided + wrong;
        let is_valid = select(0.0, 1.0, total > TINY);
        let borders = select(0.0, 1.0, (labels & BORDERS) != 0u);
        let scale = is_valid / max(total, TINY);
        own += vec4(borders * sided * scale, borders * is_valid, wrong * scale, is_valid);
    }
    let total = workgroup_sum(own, thread);
    if thread == 0u {
        partials[run.index * LANES + group.x] = total;
    }
}

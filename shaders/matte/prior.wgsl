// Included by passes that use the prior: the probability of a mixed pixel, and of a wrong map. They bind `partials`:
// per round and workgroup, of 64: sum of the posteriors of mixed pixels, number of pixels that border another surface,
// sum of the posteriors of wrong labels, number of all pixels.
// twin: `Prior` in src/depth/matting/alpha.rs

const LANES = 64u;

var<workgroup> totals: array<vec4<f32>, LANES>;

// Sum over all threads of a workgroup, in a fixed order.
fn workgroup_sum(own: vec4<f32>, thread: u32) -> vec4<f32> {
    totals[thread] = own;
    workgroupBarrier();
    for (var by = LANES / 2u; by > 0u; by /= 2u) {
        if thread < by {
            totals[thread] += totals[thread + by];
        }
        workgroupBarrier();
    }
    let total = totals[0];
    workgroupBarrier();
    return total;
}

// The prior after `round` rounds.
fn prior_after(round: u32, thread: u32) -> vec2<f32> {
    let total = workgroup_sum(partials[(max(round, 1u) - 1u) * LANES + thread], thread);
    let mixed = clamp(total.x / max(total.y, 1.0), PRIOR_MIN, MAX_MIXED);
    let wrong = clamp(total.z / max(total.w, 1.0), PRIOR_MIN, MAX_WRONG);
    return select(vec2(FIRST_MIXED, FIRST_WRONG), vec2(mixed, wrong), round > 0u);
}

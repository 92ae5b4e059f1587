// Shared by the passes that know how likely entries are mixed at all, and how often the map errs. Such a pass has `partials`: for
// each round, of each of 64 workgroups, the likelihoods of what is mixed, the number of what borders another surface, the
// likelihoods of what is wrong, and the number of all.

const LANES = 64u;

var<workgroup> totals: array<vec4<f32>, LANES>;

// The sum over all threads of a workgroup, always in the same order.
fn total_of(own: vec4<f32>, thread: u32) -> vec4<f32> {
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

// What is likely after so many rounds.
fn prior_after(round: u32, thread: u32) -> vec2<f32> {
    let total = total_of(partials[(max(round, 1u) - 1u) * LANES + thread], thread);
    let mixed = clamp(total.x / max(total.y, 1.0), PRIOR_FLOOR, MOST_MIXED);
    let wrong = clamp(total.z / max(total.w, 1.0), PRIOR_FLOOR, MOST_WRONG);
    return select(vec2(FIRST_MIXED, FIRST_WRONG), vec2(mixed, wrong), round > 0u);
}

// Pass stereo_join: joins components from row to row.
// twin: src/depth/stereo/cpu/speckle.rs

// Joins the components of two runs: the label of one root becomes the other root. If another invocation changed that
// label first, its value is joined, too. The larger of both roots decreases in every iteration.
fn join_components(one: u32, other: u32) {
    var a = root_of(one);
    var b = root_of(other);
    while a != b {
        let low = min(a, b);
        let high = max(a, b);
        let label = atomicMin(&labels[high], low);
        if label >= high {
            return;
        }
        a = root_of(label);
        b = root_of(low);
    }
}

@compute @workgroup_size(LINE)
fn stereo_join(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    let pixel = linear_index(workgroup, workgroups, thread);
    if pixel < WIDTH || pixel >= WIDTH * HEIGHT {
        return;
    }
    let above = pixel - WIDTH;
    if !is_connected(map[pixel], map[above]) {
        return;
    }
    // If both runs also touch one column further left, that invocation joins them.
    if pixel % WIDTH > 0u && is_connected(map[pixel - 1u], map[above - 1u])
        && is_connected(map[pixel - 1u], map[pixel]) && is_connected(map[above - 1u], map[above]) {
        return;
    }
    // The label of a run's first pixel may be another run of the component, which does as well.
    join_components(atomicLoad(&labels[pixel]), atomicLoad(&labels[above]));
}

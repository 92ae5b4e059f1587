// Pass stereo_join: islands are joined from row to row.

// Makes one island of those of two runs. The label of a root becomes that of the other root; where somebody else was
// quicker, what it has become is joined, too. The larger of both falls with every turn.
fn join(one: u32, other: u32) {
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
    let pixel = line_at(workgroup, workgroups, thread);
    if pixel < WIDTH || pixel >= WIDTH * HEIGHT {
        return;
    }
    let above = pixel - WIDTH;
    if !touch(map[pixel], map[above]) {
        return;
    }
    // Where both runs come from the left and touch there, too, somebody further left joins them.
    if pixel % WIDTH > 0u && touch(map[pixel - 1u], map[above - 1u])
        && touch(map[pixel - 1u], map[pixel]) && touch(map[above - 1u], map[above]) {
        return;
    }
    // The label of a run's first pixel is that of another run of the island, which will do.
    join(atomicLoad(&labels[pixel]), atomicLoad(&labels[above]));
}

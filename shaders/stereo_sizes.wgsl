// Pass stereo_sizes: how many pixels each island has, at its root; beyond ISLAND some may be missing. From here on the
// label of a run's first pixel is its island's root.

@group(0) @binding(2) var<storage, read_write> sizes: array<atomic<u32>>;

@compute @workgroup_size(LINE)
fn stereo_sizes(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                @builtin(local_invocation_index) thread: u32) {
    let pixel = line_at(workgroup, workgroups, thread);
    if pixel >= WIDTH * HEIGHT || map[pixel] == UNKNOWN {
        return;
    }
    let x = pixel % WIDTH;
    // The last pixel of a run counts them.
    if x + 1u < WIDTH && touch(map[pixel], map[pixel + 1u]) {
        return;
    }
    var first = pixel;
    if x > 0u && touch(map[pixel - 1u], map[pixel]) {
        first = atomicLoad(&labels[pixel]);
    }
    let root = root_of(first);
    atomicMin(&labels[first], root);
    // Large islands have many runs: no use in counting on.
    if atomicLoad(&sizes[root]) <= ISLAND {
        atomicAdd(&sizes[root], pixel - first + 1u);
    }
}

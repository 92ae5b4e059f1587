// Pass stereo_sizes: counts the pixels of each component at its root; counts beyond MAX_SPECKLE may be too low.
// Afterwards the label of a run's first pixel is its component's root.
// twin: src/depth/stereo/cpu/speckle.rs

@group(0) @binding(2) var<storage, read_write> sizes: array<atomic<u32>>;

@compute @workgroup_size(LINE)
fn stereo_sizes(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                @builtin(local_invocation_index) thread: u32) {
    let pixel = linear_index(workgroup, workgroups, thread);
    if pixel >= WIDTH * HEIGHT || map[pixel] == UNKNOWN {
        return;
    }
    let x = pixel % WIDTH;
    // The last pixel of a run adds its length.
    if x + 1u < WIDTH && is_connected(map[pixel], map[pixel + 1u]) {
        return;
    }
    var first = pixel;
    if x > 0u && is_connected(map[pixel - 1u], map[pixel]) {
        first = atomicLoad(&labels[pixel]);
    }
    let root = root_of(first);
    atomicMin(&labels[first], root);
    // Components beyond the limit need no further counting.
    if atomicLoad(&sizes[root]) <= MAX_SPECKLE {
        atomicAdd(&sizes[root], pixel - first + 1u);
    }
}

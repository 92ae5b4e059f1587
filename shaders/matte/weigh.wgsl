// Pass matte_weigh: computes alpha of the entries at edges, which claim the first pixels to trace.
// twin: `ComputeAlphas` in src/depth/matting/passes.rs

@group(0) @binding(1) var<storage, read> metres: array<u32>;
@group(0) @binding(2) var<storage, read> partials: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(5) var<storage, read_write> places: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> entries: array<Entry>;

@compute @workgroup_size(LANES)
fn matte_weigh(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    let prior = prior_after(PRIOR_ROUNDS, thread);
    let edges = atomicLoad(&counts[EDGES]);
    for (var k = group.x * LANES + thread; k < edges; k += groups.x * LANES) {
        let labels = atomicLoad(&entries[k].flags);
        if (labels & LONE) != 0u {
            continue;
        }
        let alpha = posterior_alpha(k, prior, labels);
        entries[k].alpha = alpha;
        if (labels & NEAR) == 0u && alpha >= MIN_TRACED_ALPHA {
            claim_neighbours(entries[k].at, entries[k].far, 0u);
        }
    }
}

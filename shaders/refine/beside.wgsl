// Pass refine_beside: for each hole, the farther one of the nearest known depths to its left and right; 0 without any.
// A workgroup processes a row, and each thread a segment of it.
// twin: `FillPass` in src/depth/fill.rs

@group(0) @binding(1) var<storage, read> counts: array<u32>;    // first, whether any hole is left
@group(0) @binding(2) var<storage, read> metres: array<f32>;
@group(0) @binding(3) var<storage, read_write> beside: array<f32>;

const THREADS = 256u;

// The first and the last known depth of each segment; 0 without any.
var<workgroup> firsts: array<f32, THREADS>;
var<workgroup> lasts: array<f32, THREADS>;

@compute @workgroup_size(THREADS)
fn refine_beside(@builtin(workgroup_id) row: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if DOWN == 1u && counts[0] == 0u {
        return;
    }
    let width = frame.size.x;
    let each = (width + THREADS - 1u) / THREADS;
    let start = row.y * width + min(thread * each, width);
    let end = row.y * width + min((thread + 1u) * each, width);
    let ends = find_known_ends(start, end - start, 1u);
    firsts[thread] = ends.x;
    lasts[thread] = ends.y;
    workgroupBarrier();
    var nearest = 0.0;
    // Forwards from the last known depth of the earlier segments, then backwards from the later ones.
    for (var part = thread; part > 0u && nearest == 0.0; part--) {
        nearest = lasts[part - 1u];
    }
    for (var k = start; k < end; k++) {
        let depth_m = metres[k];
        nearest = select(nearest, depth_m, depth_m > 0.0);
        if depth_m == 0.0 {
            beside[k] = nearest;
        }
    }
    nearest = 0.0;
    for (var part = thread + 1u; part < THREADS && nearest == 0.0; part++) {
        nearest = firsts[part];
    }
    for (var k = end; k > start; k--) {
        let depth_m = metres[k - 1u];
        nearest = select(nearest, depth_m, depth_m > 0.0);
        if depth_m == 0.0 {
            beside[k - 1u] = max(beside[k - 1u], nearest);
        }
    }
}

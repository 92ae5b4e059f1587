// Pass refine_beside: of each hole, the farther one of the nearest known depths to its left and right; 0 where there is
// none. A workgroup does a row, and each of its threads some pixels of it.

@group(0) @binding(1) var<storage, read> counts: array<u32>;    // first, whether any hole is left
@group(0) @binding(2) var<storage, read> metres: array<f32>;
@group(0) @binding(3) var<storage, read_write> beside: array<f32>;

const THREADS = 256u;

// The first and the last known depth of each part; 0 where there is none.
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
    let ends = known_ends(start, end - start, 1u);
    firsts[thread] = ends.x;
    lasts[thread] = ends.y;
    workgroupBarrier();
    var nearest = 0.0;
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

// Pass refine_fill: each hole takes the farthest of the nearest known depths above, below and beside it. A workgroup
// processes 16 columns, and each thread a strip of one. Sets a flag if a hole is left, whose row and column have no
// known depth: then both passes run again.
// twin: `FillPass` in src/depth/fill.rs

@group(0) @binding(1) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read_write> metres: array<f32>;
@group(0) @binding(3) var<storage, read_write> beside: array<f32>;

const COLUMNS = 16u;
const STRIPS = 16u;

// The first and the last known depth of each strip; 0 without any.
var<workgroup> firsts: array<f32, COLUMNS * STRIPS>;
var<workgroup> lasts: array<f32, COLUMNS * STRIPS>;
var<workgroup> is_full: u32;

@compute @workgroup_size(COLUMNS, STRIPS)
fn refine_fill(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    if DOWN == 1u {
        if thread == 0u {
            is_full = select(0u, 1u, atomicLoad(&counts[0]) == 0u);
        }
        if workgroupUniformLoad(&is_full) == 1u {
            return;
        }
    }
    let width = frame.size.x;
    let height = frame.size.y;
    let x = group.x * COLUMNS + local.x;
    let each = (height + STRIPS - 1u) / STRIPS;
    let start = min(local.y * each, height);
    // Threads beyond the last column have an empty strip.
    let end = select(start, min((local.y + 1u) * each, height), x < width);
    let ends = find_known_ends(start * width + x, end - start, width);
    firsts[thread] = ends.x;
    lasts[thread] = ends.y;
    workgroupBarrier();
    var nearest = 0.0;
    for (var strip = local.y + 1u; strip < STRIPS && nearest == 0.0; strip++) {
        nearest = firsts[strip * COLUMNS + local.x];
    }
    for (var y = end; y > start; y--) {
        let k = (y - 1u) * width + x;
        let depth_m = metres[k];
        nearest = select(nearest, depth_m, depth_m > 0.0);
        if depth_m == 0.0 {
            beside[k] = max(beside[k], nearest);
        }
    }
    nearest = 0.0;
    for (var strip = local.y; strip > 0u && nearest == 0.0; strip--) {
        nearest = lasts[(strip - 1u) * COLUMNS + local.x];
    }
    for (var y = start; y < end; y++) {
        let k = y * width + x;
        let depth_m = metres[k];
        nearest = select(nearest, depth_m, depth_m > 0.0);
        if depth_m == 0.0 {
            let filled_m = max(beside[k], nearest);
            metres[k] = filled_m;
            if filled_m == 0.0 && DOWN == 0u {
                atomicStore(&counts[0], 1u);
            }
        }
    }
}

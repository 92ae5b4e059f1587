// Pass stereo_runs: connected components within a row. The label of each pixel is the first one of its run.
// twin: src/depth/stereo/cpu/speckle.rs

@group(0) @binding(0) var<storage, read> map: array<u32>;
@group(0) @binding(1) var<storage, read_write> labels: array<u32>;
@group(0) @binding(2) var<storage, read_write> sizes: array<u32>;   // set to 0

const NONE = 0xffffffffu;

// The column in which the last run of each invocation begins.
var<workgroup> last_begins: array<u32, INVOCATIONS>;

fn begins_run(row: u32, x: u32) -> bool {
    return x == 0u || !is_connected(map[row * WIDTH + x - 1u], map[row * WIDTH + x]);
}

@compute @workgroup_size(INVOCATIONS)
fn stereo_runs(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let row = workgroup.x;
    let columns = columns_of(invocation);
    var begin = NONE;
    for (var x = columns.x; x < columns.y; x++) {
        if begins_run(row, x) {
            begin = x;
        }
    }
    last_begins[invocation] = begin;
    workgroupBarrier();
    // The run that continues from the left. Column 0 begins a run, so that one is always found.
    begin = NONE;
    for (var before = invocation; before > 0u && begin == NONE; before--) {
        begin = last_begins[before - 1u];
    }
    for (var x = columns.x; x < columns.y; x++) {
        if begins_run(row, x) {
            begin = x;
        }
        labels[row * WIDTH + x] = row * WIDTH + begin;
        sizes[row * WIDTH + x] = 0u;
    }
}

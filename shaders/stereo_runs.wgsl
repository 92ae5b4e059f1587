// Pass stereo_runs: islands, as far as they lie in one row. The label of each pixel is the first one of its run.

@group(0) @binding(0) var<storage, read> map: array<u32>;
@group(0) @binding(1) var<storage, read_write> labels: array<u32>;
@group(0) @binding(2) var<storage, read_write> sizes: array<u32>;   // become 0

const NONE = 0xffffffffu;

// The column where the last run of an invocation's columns begins.
var<workgroup> last_begins: array<u32, INVOCATIONS>;

fn begins_run(row: u32, x: u32) -> bool {
    return x == 0u || !touch(map[row * WIDTH + x - 1u], map[row * WIDTH + x]);
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
    // The run that comes from the left. Column 0 begins one, so that one is found.
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

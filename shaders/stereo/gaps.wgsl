// Pass stereo_gaps: removes speckles, and fills the gaps of each row with the farther one of the disparities left
// and right of them. Pixels left of the first known one stay unknown.
// twin: src/depth/stereo/gaps.rs

@group(0) @binding(0) var<storage, read> labels: array<u32>;
@group(0) @binding(1) var<storage, read> sizes: array<u32>;
@group(0) @binding(2) var<storage, read_write> map: array<u32>;     // without speckles afterwards, for the next pair
@group(0) @binding(3) var<storage, read_write> filled: array<u32>;

// The first and the last known disparity of each invocation's columns.
var<workgroup> firsts: array<u32, INVOCATIONS>;
var<workgroup> lasts: array<u32, INVOCATIONS>;

@compute @workgroup_size(INVOCATIONS)
fn stereo_gaps(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let columns = workgroup.x * WIDTH + columns_of(invocation);
    var left = UNKNOWN;
    var right = UNKNOWN;
    for (var at = columns.x; at < columns.y; at++) {
        var disparity = map[at];
        // The label of a pixel is the first one of its run, whose label is the root.
        if sizes[labels[labels[at]]] <= MAX_SPECKLE {
            disparity = UNKNOWN;
            map[at] = UNKNOWN;
        }
        if disparity != UNKNOWN {
            left = disparity;
            right = select(right, disparity, right == UNKNOWN);
        }
    }
    firsts[invocation] = right;
    lasts[invocation] = left;
    workgroupBarrier();
    left = UNKNOWN;
    for (var k = invocation; k > 0u && left == UNKNOWN; k--) {
        left = lasts[k - 1u];
    }
    right = UNKNOWN;
    for (var k = invocation + 1u; k < INVOCATIONS && right == UNKNOWN; k++) {
        right = firsts[k];
    }
    for (var at = columns.x; at < columns.y; at++) {
        left = select(map[at], left, map[at] == UNKNOWN);
        filled[at] = left;
    }
    for (var at = columns.y; at > columns.x; at--) {
        let disparity = map[at - 1u];
        let before = filled[at - 1u];
        if disparity != UNKNOWN {
            right = disparity;
        } else if before != UNKNOWN {
            // UNKNOWN is the largest number: at the right border the only side wins.
            filled[at - 1u] = min(before, right) | FILLED;
        }
    }
}

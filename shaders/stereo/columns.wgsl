// Pass stereo_columns: the path of semi-global aggregation down each column, which completes the sums.
// twin: src/depth/stereo/cpu/path.rs

@group(0) @binding(0) var<storage, read> costs: array<u32>;
@group(0) @binding(1) var<storage, read> penalties: array<u32>;
@group(0) @binding(2) var<storage, read> sums: array<u32>;          // half of the values of the paths along rows
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;  // of all paths, at `total_index`

fn pixel_at(column: u32, step: u32) -> u32 {
    return min(step, HEIGHT - 1u) * WIDTH + column;
}

// Returns P2 between a pixel and the one above it.
fn penalty_at(pixel: u32) -> u32 {
    return penalties[pixel] >> 8u;
}

fn sum_at(cell: u32) -> u32 {
    return sums[cell];
}

fn store_sum(column: u32, step: u32, word: u32, sum: u32) {
    if step < HEIGHT {
        totals[total_index(column, step, word)] = sum;
    }
}

@compute @workgroup_size(WORDS)
fn stereo_columns(@builtin(workgroup_id) column: vec3<u32>, @builtin(local_invocation_index) word: u32) {
    trace_path(column.x, HEIGHT, word);
}

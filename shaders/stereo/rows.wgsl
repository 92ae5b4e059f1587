// Pass stereo_rows: the path of semi-global aggregation along each row, first from the left, then from the right.
// twin: src/depth/stereo/cpu/path.rs

@group(0) @binding(0) var<storage, read> costs: array<u32>;
@group(0) @binding(1) var<storage, read> penalties: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;    // half of the path values, laid out like costs

fn pixel_at(row: u32, step: u32) -> u32 {
    let x = min(step, WIDTH - 1u);
    return row * WIDTH + select(x, WIDTH - 1u - x, FROM_RIGHT == 1u);
}

// Returns P2 between a pixel and the previous one of the path. At the start of a path the value does not matter.
fn penalty_at(pixel: u32) -> u32 {
    return penalties[min(pixel + FROM_RIGHT, WIDTH * HEIGHT - 1u)] & 255u;
}

fn sum_at(cell: u32) -> u32 {
    if FROM_RIGHT == 1u {
        return sums[cell];
    }
    // The buffer still has the sums of the last pair.
    return 0u;
}

fn store_sum(row: u32, step: u32, word: u32, sum: u32) {
    if step < WIDTH {
        sums[pixel_at(row, step) * WORDS + word] = sum;
    }
}

@compute @workgroup_size(WORDS)
fn stereo_rows(@builtin(workgroup_id) row: vec3<u32>, @builtin(local_invocation_index) word: u32) {
    trace_path(row.x, WIDTH, word);
}

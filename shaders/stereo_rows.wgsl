// Pass stereo_rows: the path along each row, first from the left, then back from the right.

@group(0) @binding(0) var<storage, read> costs: array<u32>;
@group(0) @binding(1) var<storage, read> penalties: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;    // of half the paths' values, laid out as the costs

fn pixel_at(row: u32, step: u32) -> u32 {
    let x = min(step, WIDTH - 1u);
    return row * WIDTH + select(x, WIDTH - 1u - x, BACK == 1u);
}

// Between a pixel and the one on its left, or on its right. Where a path begins any will do.
fn penalty_at(pixel: u32) -> u32 {
    return penalties[min(pixel + BACK, WIDTH * HEIGHT - 1u)] & 255u;
}

fn sum_at(cell: u32) -> u32 {
    if BACK == 1u {
        return sums[cell];
    }
    // Whatever is there is of the pair before.
    return 0u;
}

fn leave(row: u32, step: u32, word: u32, sum: u32) {
    if step < WIDTH {
        sums[pixel_at(row, step) * WORDS + word] = sum;
    }
}

@compute @workgroup_size(WORDS)
fn stereo_rows(@builtin(workgroup_id) row: vec3<u32>, @builtin(local_invocation_index) word: u32) {
    walk(row.x, WIDTH, word);
}

// Pass stereo_winners: winner takes all with the left-right consistency check, in fixed point.
// twin: src/depth/stereo/cpu/winner.rs

@group(0) @binding(0) var<storage, read> totals: array<u32>;
@group(0) @binding(1) var<storage, read_write> map: array<u32>;

fn load_total(x: u32, y: u32, disparity: u32) -> u32 {
    return (totals[total_index(x, y, disparity / 4u)] >> (8u * (disparity % 4u))) & 255u;
}

// Returns the winner of a left pixel. With the disparity in the low byte, the lowest of equal sums wins.
fn left_winner(x: u32, y: u32) -> u32 {
    var best = vec4(0xffffffffu);
    for (var word = 0u; word < WORDS; word++) {
        let disparities = 4u * word + vec4(0u, 1u, 2u, 3u);
        best = min(best, (unpack4xU8(totals[total_index(x, y, word)]) << vec4(8u)) | disparities);
    }
    return min_of(best) & 255u;
}

// Returns the winner of a right pixel, over all left pixels that may be its partner.
fn right_winner(x: u32, y: u32) -> u32 {
    var best = 0xffffffffu;
    for (var disparity = 0u; disparity < min(4u * WORDS, WIDTH - x); disparity++) {
        best = min(best, (load_total(x + disparity, y, disparity) << 8u) | disparity);
    }
    return best & 255u;
}

// Refines to subpixel accuracy by equiangular line fitting through the sums at `disparity` and beside it.
fn subpixel_disparity(x: u32, y: u32, disparity: u32) -> u32 {
    let whole = disparity * ONE;
    if disparity == 0u || disparity + 1u >= 4u * WORDS {
        return whole;
    }
    let below = i32(load_total(x, y, disparity - 1u));
    let above = i32(load_total(x, y, disparity + 1u));
    let slope = max(below, above) - i32(load_total(x, y, disparity));
    if slope == 0 {
        return whole;
    }
    return u32(i32(whole) + (below - above) * i32(ONE / 2u) / slope);
}

fn consistent_disparity(x: u32, y: u32) -> u32 {
    let disparity = left_winner(x, y);
    if disparity > x || abs_diff(right_winner(x - disparity, y), disparity) > MAX_LR_DIFFERENCE {
        return UNKNOWN;
    }
    return subpixel_disparity(x, y, disparity);
}

@compute @workgroup_size(LINE)
fn stereo_winners(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                  @builtin(local_invocation_index) thread: u32) {
    let pixel = linear_index(workgroup, workgroups, thread);
    if pixel < WIDTH * HEIGHT {
        map[pixel] = consistent_disparity(pixel % WIDTH, pixel / WIDTH);
    }
}

// Pass stereo_likely: one more than the pixel's disparity in the last pair, in whole pixels, where the picture around
// it has not changed since; else 0.
// twin: src/depth/stereo/cpu/prior.rs

@group(0) @binding(0) var<storage, read> luma: array<u32>;      // left picture first
@group(0) @binding(1) var<storage, read> last: array<u32>;      // left picture of the last pair
@group(0) @binding(2) var<storage, read> map: array<u32>;       // disparities of the last pair
@group(0) @binding(3) var<storage, read_write> likely: array<u32>;

fn change_at(x: u32, y: u32) -> u32 {
    let at = y * WIDTH + x;
    let shift = 8u * (at % 4u);
    return abs_diff((luma[at / 4u] >> shift) & 255u, (last[at / 4u] >> shift) & 255u);
}

// Returns the sum over 3x3 pixels; beyond the border the outermost ones repeat.
fn change_around(x: u32, y: u32) -> u32 {
    let columns = vec3(max(x, 1u) - 1u, x, min(x + 1u, WIDTH - 1u));
    var sum = 0u;
    for (var k = 0u; k < 3u; k++) {
        let row = clamp(y + k, 1u, HEIGHT) - 1u;
        sum += change_at(columns.x, row) + change_at(columns.y, row) + change_at(columns.z, row);
    }
    return sum;
}

@compute @workgroup_size(LINE)
fn stereo_likely(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                 @builtin(local_invocation_index) thread: u32) {
    let pixel = linear_index(workgroup, workgroups, thread);
    if pixel >= WIDTH * HEIGHT {
        return;
    }
    let disparity = map[pixel];
    let holds = disparity != UNKNOWN && change_around(pixel % WIDTH, pixel / WIDTH) <= MAX_NOISE;
    likely[pixel] = select(0u, (disparity + ONE / 2u) / ONE + 1u, holds);
}

// Pass stereo_census: the census transform of both pictures (Zabih and Woodfill, ECCV 1994); and the penalty P2 between
// each left pixel and the one on its left (lowest byte) and above it (next byte).
// twin: src/depth/stereo/cpu/census.rs

@group(0) @binding(0) var<storage, read> luma: array<u32>;      // left, then right, each aligned to a word
@group(0) @binding(1) var<storage, read> table: array<u32>;     // P2 by the difference of grey values, in bytes
@group(0) @binding(2) var<storage, read_write> census: array<u32>;
@group(0) @binding(3) var<storage, read_write> penalties: array<u32>;

const RADIUS = 4;

fn luma_at(x: u32, y: u32, camera: u32) -> u32 {
    let at = y * WIDTH + x;
    return (luma[camera * ((WIDTH * HEIGHT + 3u) / 4u) + at / 4u] >> (8u * (at % 4u))) & 255u;
}

fn penalty_of(step: u32) -> u32 {
    return (table[step / 4u] >> (8u * (step % 4u))) & 255u;
}

@compute @workgroup_size(16, 16)
fn stereo_census(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= WIDTH || id.y >= HEIGHT {
        return;
    }
    let x = id.x;
    let y = id.y;
    let camera = id.z;
    let center = luma_at(x, y, camera);
    var code = 0u;
    for (var bit = 0u; bit < 24u; bit++) {
        // The 13th of the 5x5 samples is the pixel itself.
        let cell = select(bit + 1u, bit, bit < 12u);
        // Beyond the border the outermost pixels repeat.
        let beside = vec2<i32>(id.xy) + vec2<i32>(vec2(cell % 5u, cell / 5u)) * 2 - RADIUS;
        let at = vec2<u32>(clamp(beside, vec2(0), vec2<i32>(vec2(WIDTH, HEIGHT)) - 1));
        code |= select(0u, 1u << bit, luma_at(at.x, at.y, camera) < center);
    }
    let pixel = y * WIDTH + x;
    census[camera * WIDTH * HEIGHT + pixel] = code;
    if camera == 0u {
        let left = penalty_of(abs_diff(center, luma_at(max(x, 1u) - 1u, y, 0u)));
        let above = penalty_of(abs_diff(center, luma_at(x, max(y, 1u) - 1u, 0u)));
        penalties[pixel] = left | (above << 8u);
    }
}

// Pass refine_change: the colour change around each pixel since the last frame, summed over 3x3 pixels; the border
// repeats.
// twin: `ColorChange` in src/depth/refine/temporal.rs

@group(0) @binding(1) var<storage, read> colors: array<u32>;
@group(0) @binding(2) var<storage, read> before: array<u32>;
@group(0) @binding(3) var<storage, read_write> change: array<u32>;

@compute @workgroup_size(16, 16)
fn refine_change(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    var sum = 0u;
    for (var n = 0u; n < 9u; n++) {
        // Offset by one, so that coordinates stay unsigned.
        let at = clamp(id.xy + vec2(n % 3u, n / 3u), vec2(1u), frame.size) - 1u;
        let k = at.y * frame.size.x + at.x;
        let now = vec4<i32>(unpack4xU8(colors[k]));
        let apart = abs(now - vec4<i32>(unpack4xU8(before[k])));
        sum += u32(apart.x + apart.y + apart.z);
    }
    change[id.y * frame.size.x + id.x] = sum;
}

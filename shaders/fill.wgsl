// Pass fill: in the scene, near objects and the mixed pixels around them become what lies behind.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> hidden: array<f32>;
@group(0) @binding(2) var<storage, read> pyramid: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> scene: array<vec4<f32>>;

@compute @workgroup_size(16, 16)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let size = (frame.size + 1u) / 2u;
    let at = id.xy / 2u;
    let first = at - min(at, vec2(1u));
    let last = min(at + 1u, size - 1u);
    var most = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            most = max(most, hidden[y * size.x + x]);
        }
    }
    if most > 0.0 {
        let value = pyramid[at.y * size.x + at.x];
        scene[id.y * frame.size.x + id.x] = vec4(value.rgb, max(value.w, frame.nearest_px));
    }
}

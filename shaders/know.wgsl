// Pass know: the finest level of the pyramid: colour and CoC as far as neither the pixel nor a neighbour is hidden by what
// lies in front of the layer.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> nearest_px: array<f32>;
@group(0) @binding(4) var<storage, read_write> pyramid: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> known: array<f32>;

@compute @workgroup_size(TILE, TILE)
fn know(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = (frame.size + 1u) / 2u;
    if any(id.xy >= size) {
        return;
    }
    let first = id.xy - min(id.xy, vec2(1u));
    let last = min(id.xy + 1u, size - 1u);
    var nearest = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            nearest = min(nearest, nearest_px[y * size.x + x]);
        }
    }
    var sum = vec4(0.0);
    for (var sub = 0u; sub < 4u; sub++) {
        let at = min(2u * id.xy + vec2(sub % 2u, sub / 2u), frame.size - 1u);
        sum += 0.25 * scene_unpacked(scene[at.y * frame.size.x + at.x], frame.most_px);
    }
    let index = id.y * size.x + id.x;
    let knows = step_at(work.unhidden, nearest);
    pyramid[index] = sum * knows;
    known[index] = knows;
}

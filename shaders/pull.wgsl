// Pass pull: one level of the pyramid to the next coarser one, known pixels only.

struct Level {
    fine: vec2<u32>,
    coarse: vec2<u32>,
    fine_offset: u32,
    coarse_offset: u32,
    unused: vec2<u32>,
}

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read_write> pyramid: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> known: array<f32>;

@compute @workgroup_size(8, 8)
fn pull(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= level.coarse) {
        return;
    }
    var sum = vec4(0.0);
    var knows = 0.0;
    for (var sub = 0u; sub < 4u; sub++) {
        let at = 2u * id.xy + vec2(sub % 2u, sub / 2u);
        if all(at < level.fine) {
            let index = level.fine_offset + at.y * level.fine.x + at.x;
            sum += pyramid[index];
            knows += known[index];
        }
    }
    let scale = 1.0 / max(knows, 1.0);
    let index = level.coarse_offset + id.y * level.coarse.x + id.x;
    pyramid[index] = sum * scale;
    known[index] = knows * scale;
}

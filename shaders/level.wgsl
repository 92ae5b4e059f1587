// Shared by the passes that go from one level of the pyramid to the next.

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

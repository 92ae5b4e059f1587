// Pass clear: empties the tile lists and the coarse grid.

@group(0) @binding(0) var<storage, read_write> binned: array<u32>;
@group(0) @binding(1) var<storage, read_write> filtered: array<u32>;
@group(0) @binding(2) var<storage, read_write> active_tiles: array<u32>;
@group(0) @binding(3) var<storage, read_write> grid: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP_1D)
fn clear(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let step = workgroups.x * WORKGROUP_1D;
    for (var k = id.x; k < listed_offset(arrayLength(&binned)); k += step) {
        binned[k] = 0u;
    }
    for (var k = id.x; k < listed_offset(arrayLength(&filtered)); k += step) {
        filtered[k] = 0u;
    }
    for (var k = id.x; k < listed_offset(arrayLength(&active_tiles)); k += step) {
        active_tiles[k] = 0u;
    }
    for (var k = id.x; k < arrayLength(&grid); k += step) {
        grid[k] = vec4(0.0);
    }
}

// Shared by passes over several bins at once: the bin and tile of a workgroup. Such a pass binds `work` and `bins`, and
// defines `work_size`, the size of a bin to divide into tiles.

struct TileRef {
    bin: u32,
    tile: vec2<u32>,
    some: bool,     // false past the last tile
}

fn find_tile(workgroup: vec3<u32>, workgroups: vec3<u32>, tile: vec2<u32>) -> TileRef {
    var left = workgroup.y * workgroups.x + workgroup.x;
    for (var k = work.first; k < work.first + work.count; k++) {
        let tiles = (work_size(k) + tile - 1u) / tile;
        if left < tiles.x * tiles.y {
            return TileRef(k, vec2(left % tiles.x, left / tiles.x), true);
        }
        left -= tiles.x * tiles.y;
    }
    return TileRef(0u, vec2(0u), false);
}

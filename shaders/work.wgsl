// Shared by passes over several bins at once: the bin and tile of a workgroup. Such a pass binds `work` and `bins`, and
// defines `extent_of`, the size of a bin to divide into tiles.

struct Place {
    bin: u32,
    tile: vec2<u32>,
    some: bool,     // false past the last tile
}

fn place_of(workgroup: vec3<u32>, workgroups: vec3<u32>, tile: vec2<u32>) -> Place {
    var left = workgroup.y * workgroups.x + workgroup.x;
    for (var k = work.first; k < work.first + work.count; k++) {
        let tiles = (extent_of(k) + tile - 1u) / tile;
        if left < tiles.x * tiles.y {
            return Place(k, vec2(left % tiles.x, left / tiles.x), true);
        }
        left -= tiles.x * tiles.y;
    }
    return Place(0u, vec2(0u), false);
}

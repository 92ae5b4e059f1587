// Shared by passes over the tiles of a list. Such a pass binds the list `todo`, and `work` for its bins; its workgroups
// loop over the tiles.

struct TileRef {
    bin: u32,
    tile: u32,
    some: bool,     // false past the last tile
}

// Tile `number` of the bins of `work`; those of bin k begin at offset `list_offset(k)`.
fn find_tile(number: u32) -> TileRef {
    var left = number;
    for (var k = work.first; k < work.first + work.count; k++) {
        if left < todo[k] {
            return TileRef(k, todo[listed_offset(arrayLength(&todo)) + list_offset(k) + left], true);
        }
        left -= todo[k];
    }
    return TileRef(0u, 0u, false);
}

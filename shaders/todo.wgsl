// Shared by passes over the tiles of a list. Such a pass binds the list `todo`, and `work` for its bins; its workgroups
// loop over the tiles.

struct Place {
    bin: u32,
    tile: u32,
    some: bool,     // false past the last tile
}

// Tile `number` of the bins of `work`; those of bin k begin at offset `list_at(k)`.
fn place_of(number: u32) -> Place {
    var left = number;
    for (var k = work.first; k < work.first + work.count; k++) {
        if left < todo[k] {
            return Place(k, todo[places_at(arrayLength(&todo)) + list_at(k) + left], true);
        }
        left -= todo[k];
    }
    return Place(0u, 0u, false);
}

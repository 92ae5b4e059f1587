// Shared by the passes that do the tiles of a list: `todo`, the list, and `work`, its bins. So many workgroups take turns.

struct Place {
    bin: u32,
    tile: u32,
    some: bool,     // false past the last one
}

// A tile of some bins; those of bin k are at `list_at(k)` among all.
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

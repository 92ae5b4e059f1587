// Shared by the passes that list tiles for a later one, in `next`.

// Lists a tile of a bin, whose tiles begin at `first` among all, unless it is listed already.
fn put(k: u32, first: u32, tile: u32) {
    let flag = HEAD + first + tile;
    if atomicLoad(&next[flag]) == 0u && atomicExchange(&next[flag], 1u) == 0u {
        let place = atomicAdd(&next[k], 1u);
        atomicStore(&next[places_at(arrayLength(&next)) + first + place], tile);
    }
}

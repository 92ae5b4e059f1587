// Shared by passes that list tiles for a later pass, in `next`.

// Lists a tile of a bin, whose tiles begin at offset `first`, unless it is listed already.
fn list_tile(k: u32, first: u32, tile: u32) {
    let flag = HEAD + first + tile;
    if atomicLoad(&next[flag]) == 0u && atomicExchange(&next[flag], 1u) == 0u {
        let place = atomicAdd(&next[k], 1u);
        atomicStore(&next[listed_offset(arrayLength(&next)) + first + place], tile);
    }
}

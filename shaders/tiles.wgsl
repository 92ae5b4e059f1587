// Shared by passes that index the tiles of a bin, row by row. Such a pass binds the uniform `bins`.

// Threads per axis that share a pixel of a bin in pass bin.
fn sharing(k: u32) -> u32 {
    return select(1u, 2u, bins[k].scale >= SHARED_FROM);
}

fn binned_across(k: u32) -> u32 {
    return (bins[k].size.x * sharing(k) + TILE - 1u) / TILE;
}

fn filtered_across(k: u32) -> u32 {
    return (bins[k].size.x + ROWS_TILE_X - 1u) / ROWS_TILE_X;
}

fn active_across(k: u32) -> u32 {
    return (bins[k].size.x + RESULT_TILE_X - 1u) / RESULT_TILE_X;
}

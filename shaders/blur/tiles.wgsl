// Shared by passes that index the tiles of a bin, row by row. Such a pass binds the uniform `bins`.

// Threads per axis that share a pixel of a bin in pass bin.
fn threads_per_axis(k: u32) -> u32 {
    return select(1u, 2u, bins[k].scale >= SHARED_FROM_SCALE);
}

fn bin_tiles_across(k: u32) -> u32 {
    return (bins[k].size.x * threads_per_axis(k) + TILE - 1u) / TILE;
}

fn row_tiles_across(k: u32) -> u32 {
    return (bins[k].size.x + ROWS_TILE_X - 1u) / ROWS_TILE_X;
}

fn result_tiles_across(k: u32) -> u32 {
    return (bins[k].size.x + RESULT_TILE_X - 1u) / RESULT_TILE_X;
}

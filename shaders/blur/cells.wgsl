// Shared by passes that use the grid of silhouettes.

// Columns and rows of the grid.
fn silhouette_grid_size(size: vec2<u32>) -> vec2<u32> {
    return (size + SILHOUETTE_CELL - 1u) / SILHOUETTE_CELL;
}

// Largest radius of any silhouette, in cells.
fn max_radius_cells() -> u32 {
    return u32(2.0 * frame.max_px + MARGIN_PX) / SILHOUETTE_CELL + 1u;
}

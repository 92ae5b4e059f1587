// Shared by passes that use the grid of silhouettes.

// Columns and rows of the grid.
fn cells_of(size: vec2<u32>) -> vec2<u32> {
    return (size + GRAIN - 1u) / GRAIN;
}

// Largest radius of any silhouette, in cells.
fn max_radius_cells() -> u32 {
    return u32(2.0 * frame.max_px + MARGIN_PX) / GRAIN + 1u;
}

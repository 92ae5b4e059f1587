// Shared by the passes that know the grid of silhouettes.

// Its columns and rows.
fn cells_of(size: vec2<u32>) -> vec2<u32> {
    return (size + GRAIN - 1u) / GRAIN;
}

// How many cells away the farthest silhouette can reach one.
fn farthest() -> u32 {
    return u32(2.0 * frame.most_px + MARGIN_PX) / GRAIN + 1u;
}

// Shared by passes that read pixels of bins: those in cells without coverage were not written. Such a pass binds `bins` and
// `grid`.

fn is_covered(k: u32, pixel: vec2<u32>) -> bool {
    let cell = pixel / CELL;
    return grid[2u * (bins[k].cells_at + cell.y * bins[k].cells.x + cell.x)].x > 0.0;
}

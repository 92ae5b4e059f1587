// Shared by the passes that make the result of a bin. Such a pass has `bins`, `frame` and, for each tile of the picture, the bits
// of the bins that it shows, `shown`.

// Notes that the tiles of the picture over a tile of the bin, and next to it, show the bin.
fn show(k: u32, tile: vec2<u32>, thread: u32) {
    let across = (frame.size + TILE - 1u) / TILE;
    let corner = tile * result_tile() * bins[k].scale;
    let first = (corner - min(corner, vec2(bins[k].scale))) / TILE;
    let last = min((corner + (result_tile() + 1u) * bins[k].scale) / TILE, across - 1u);
    let count = last - first + 1u;
    for (var n = thread; n < count.x * count.y; n += RESULT_TILE_X * RESULT_TILE_Y) {
        let at = first + vec2(n % count.x, n / count.x);
        atomicOr(&shown[at.y * across.x + at.x], 1u << k);
    }
}

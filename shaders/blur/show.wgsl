// Shared by passes that write the result of a bin. Such a pass binds `bins`, `frame` and `shown`: per tile of the
// picture a bit mask of the bins with content there.

// Marks the bin in the tiles of the picture that a tile of the bin overlaps or touches.
fn mark_shown_tiles(k: u32, tile: vec2<u32>, thread: u32) {
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

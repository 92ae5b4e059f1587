// Shared by passes that know the CoC range of a tile of the picture: they list, in `next`, the tiles of those bins of
// `work` that depend on it. Four threads per bin: a tile of the picture contributes to at most four tiles of a bin.

fn list_bin_tiles(tile: vec2<u32>, range: vec2<f32>, thread: u32) {
    let k = work.first + thread / 4u;
    if k >= work.first + work.count {
        return;
    }
    let overlaps = linear_step(bins[k].front, range.y) > 0.0 && linear_step(bins[k].behind, range.x) < 1.0;
    if !overlaps && bins[k].whole == 0u {
        return;
    }
    // Pixels of the bin whose tent includes the tile: see tent.wgsl.
    let scale = bins[k].scale;
    let corner = tile * TILE / scale;
    let before = select(vec2(0u), min(corner, vec2(1u)), scale > 1u);
    let end = (tile * TILE + TILE - 1u + scale / 2u) / scale;
    let side = TILE / threads_per_axis(k);
    let at = (corner - before) / side + vec2(thread % 2u, thread / 2u % 2u);
    if all(at <= min(end, bins[k].size - 1u) / side) {
        list_tile(k, bins[k].binned_at, at.y * bin_tiles_across(k) + at.x);
    }
}

// Shared by the passes that average the colours of bins over larger cells. Such a pass binds `bins` and `means`, in which
// the cells of a bin begin at the offset of its pixels: mean colour, and weight.

// Weight below which a colour has none, which avoids a division by 0.
const MIN_WEIGHT = 1e-20;

fn means_size(k: u32) -> vec2<u32> {
    return (bins[k].size + bins[k].decimation - 1u) / bins[k].decimation;
}

fn mean_index(k: u32, cell: vec2<u32>) -> u32 {
    return bins[k].pixels_at + cell.y * means_size(k).x + cell.x;
}

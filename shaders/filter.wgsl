// Shared by the two filter passes: the taps at a pixel, linear between the edges of its segment.

struct Group {
    index: u32,     // which four terms
    terms: u32,     // how many of them are there
    last: u32,      // 1: the sum is complete
    unused: u32,
}

struct Taps {
    left: u32,      // tap 0 at the left edge
    right: u32,
    along: f32,     // 0 at the left edge, 1 at the right
    reach: i32,
}

// Row above, row below and how far between them a row of the bin lies, in rows of cells.
struct Between {
    above: u32,
    below: u32,
    share: f32,
}

fn between_cells(y: u32, cells_down: u32) -> Between {
    let along = max((f32(y) - (f32(CELL) - 1.0) / 2.0) / f32(CELL), 0.0);
    let above = min(u32(along), cells_down - 1u);
    return Between(above, min(above + 1u, cells_down - 1u), along - f32(above));
}

// Where tap 0 of a node is in the bank.
fn node_origin(node: u32, reach: u32, groups: u32, group_index: u32) -> u32 {
    return (node * (2u * reach + 1u) + reach) * groups + group_index;
}

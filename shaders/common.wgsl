// Shared by every pass: the uniforms, whose fields equal those of the Rust structs of the same names, and the numbers
// that are defined once, in Rust.

override CELL: u32;                 // bin pixels a side of a cell
override SEGMENT: u32;              // bin pixels between two edges
override COVERAGE_FLOOR: f32;       // less coverage than this has no colour of its own
override FAR_WEIGHT: f32;           // weight of far cells in the local radius
override HINDMOST_COVERAGE: f32;    // a bin counts wholly from here on when the hindmost is looked for

const MAX_BINS = 13;

// One frame.
struct Frame {
    size: vec2<u32>,            // columns, rows
    depth_size: vec2<u32>,
    coc_kind: u32,              // 0 uniform, 1 ramp, 2 depth
    compositing: u32,           // 0 layers, 1 select, 2 gather
    bins: u32,
    near_bins: u32,             // they come first
    reach: u32,                 // of the bank
    nodes: u32,
    groups: u32,                // of four terms each
    unused: u32,
    coc: vec4<f32>,             // uniform: radius; ramp: normal, offset, half band; depth: c_inf, focus, max
    ramp: vec2<f32>,            // slope, max
    expansion: f32,             // 0: highlights stay as they are
    steps_per_px: f32,          // nodes of the bank per pixel of radius
    rest_front: vec2<f32>,      // border between the near bins and the rest: CoC, slope
    nearest_px: f32,            // no filled CoC is below this
    unused_too: f32,
}

// One bin. Offsets are in elements of the buffers that all bins share.
struct Bin {
    size: vec2<u32>,            // columns, rows
    cells: vec2<u32>,
    scale: u32,
    edges: u32,                 // across
    turned: u32,
    whole: u32,                 // 1: takes every pixel, whatever its CoC
    front: vec2<f32>,           // border to the bin in front: CoC, slope
    behind: vec2<f32>,
    max_radius_px: f32,
    sigma_cells: f32,
    reach_cells: u32,
    pixels_at: u32,             // of its pixels
    rows_at: u32,               // of its pixels among those filtered at once
    edges_at: u32,
    cells_at: u32,
    rows_apart: u32,            // pixels filtered at once: from one term's rows to the next one's
}

fn step_at(border: vec2<f32>, coc_px: f32) -> f32 {
    return clamp((coc_px - border.x) * border.y + 0.5, 0.0, 1.0);
}

// How much of a pixel a bin takes.
fn share_at(front: vec2<f32>, behind: vec2<f32>, coc_px: f32) -> f32 {
    return step_at(front, coc_px) - step_at(behind, coc_px);
}

// The node of the bank nearest to a radius.
fn node_at(radius_px: f32, steps_per_px: f32, nodes: u32) -> u32 {
    return min(u32(radius_px * steps_per_px + 0.5), nodes - 1u);
}

// Highlights: all channels share a factor of the luminance, so that the hue stays.
fn luminance(light: vec3<f32>) -> f32 {
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

// Shared by every pass: the uniforms, mirrored by Rust structs of the same names, and the constants set by Rust.

override CELL: u32;                 // side of a cell in bin pixels
override SEGMENT: u32;              // bin pixels between two edges
override UNBOUNDED_COLOR: f32;      // larger than any colour
override MIN_COVERAGE: f32;         // a bin pixel with less coverage has no colour of its own
override MIN_CELL_WEIGHT: f32;      // smallest weight of a cell in the local radius
override OTHER_SURFACE_FROM: f32;   // relative CoC step of a near pixel: below this, the same surface is behind it,
override OTHER_SURFACE_TO: f32;     // from this on, a different one
override HIDING_WEIGHT: f32;        // a bin with this weight of a nearer surface hides the farther one
override HINDMOST_COVERAGE: f32;    // coverage from which a bin fully counts as the hindmost
override SILHOUETTE_CELL: u32;      // side of a cell of the silhouettes' grid in pixels
override MARGIN_PX: f32;            // added to silhouette distances, because that grid is coarse
override CROSS_FADE: f32;           // half the width of a cross-fade of bins, relative to the border's CoC
override FADE_FRACTION: f32;        // fraction of a silhouette's squared radius over which it fades out
override MIN_OWN_COVERAGE: f32;     // a surface with less coverage does not fill a pixel
override OCTAVES_FROM_PX: f32;      // from this radius on, nodes are linear within each octave
override OCTAVE_SHIFT: u32;         // right shift of a float that leaves its node in the octave
override SPLINE_LEFT: f32;          // see src/bokeh/bank/reduced.rs
override CELL_SHARPNESS: f32;       // how much averaged colours are sharpened, per neighbour
override EXTRA_TAPS: u32;           // taps beyond the aperture in filters for reduced scales

// Workgroup sizes, in pixels or elements of the pass: squares, lines, row tiles and result tiles of a bin.
override TILE: u32;
override SMALL_TILE: u32;
override WORKGROUP_1D: u32;
override ROWS_TILE_X: u32;
override ROWS_TILE_Y: u32;
override RESULT_TILE_X: u32;
override RESULT_TILE_Y: u32;
override SHARED_FROM_SCALE: u32;    // scale from which four threads of pass bin share a pixel

const MAX_BINS = 11;
const MIXED_FLAG = 0x8000u; // flag of a scene pixel: see pack_scene

// One frame.
struct Frame {
    size: vec2<u32>,            // columns, rows
    depth_size: vec2<u32>,
    coc_kind: u32,              // 0 uniform, 1 ramp, 2 depth
    compositing: u32,           // 0 layers, 1 select, 2 gather
    bins: u32,
    near_bins: u32,             // the first bins
    half_width: u32,            // half-width of the bank
    nodes: u32,
    groups: u32,                // groups of four terms
    max_px: f32,                // upper bound of |CoC|
    coc: vec4<f32>,             // uniform: radius; ramp: normal, offset, half band; depth: c_inf, sharp range, max
    ramp: vec2<f32>,            // slope, max
    expansion: f32,             // highlight expansion 1 + 1/M; 0: off
    steps_per_px: f32,          // nodes per pixel of radius, below OCTAVES_FROM_PX
    mixed: u32,                 // number of mixed pixels
    symmetric: u32,             // 1: symmetric kernel, taps at -j and j are equal
    extent: f32,                // distance of the aperture's outermost point, in radii
    term_stride: u32,           // pixels of a batch: stride between the rows of two terms
    yuyv: u32,                  // 1: the result is YUYV
    front_px: f32,              // above this CoC nothing is in front of the subject
    has_reduced: u32,           // 1: the bank has filters for reduced scales
}

// Parameters of a dispatch: some bins, of one layer if it goes over the picture.
struct Work {
    first: u32,                 // first bin
    count: u32,                 // number of bins
    group: u32,                 // index of the group of four terms
    terms: u32,                 // terms in the group
    last: u32,                  // 1: last group, the sum is complete
    nearest_px: f32,            // lower bound of inpainted CoC in the layer
    visible_weight: vec2<f32>,  // weight of a pixel's own content in the layer: CoC of the step, slope
}

// One bin. Offsets are in elements of the buffers that all bins share.
struct Bin {
    size: vec2<u32>,            // columns, rows
    cells: vec2<u32>,
    scale: u32,
    edges: u32,                 // segment edges across
    decimation: u32,            // side of the cells to which colours are averaged, in bin pixels; 1: they are not
    whole: u32,                 // 1: weight 1 for every pixel
    front: vec2<f32>,           // border to the bin in front: CoC, slope
    behind: vec2<f32>,
    max_radius_px: f32,
    sigma_cells: f32,
    radius_cells: u32,
    pixels_at: u32,             // offset of its pixels
    rows_at: u32,               // offset of its pixels in the batch
    edges_at: u32,
    cells_at: u32,
    binned_at: u32,             // offset of its tiles in pass bin
    half_width: u32,            // outermost tap of any pixel
    filtered_at: u32,           // offset of its row tiles
    active_at: u32,             // offset of its result tiles
    has_overshoot: u32,         // 1: results are clamped to the range of nearby colours
}

fn rows_tile() -> vec2<u32> {
    return vec2(ROWS_TILE_X, ROWS_TILE_Y);
}

fn result_tile() -> vec2<u32> {
    return vec2(RESULT_TILE_X, RESULT_TILE_Y);
}

// Index of the tile that contains a pixel, row by row.
fn tile_index(pixel: vec2<u32>, width: u32, tile: vec2<u32>) -> u32 {
    return pixel.y / tile.y * ((width + tile.x - 1u) / tile.x) + pixel.x / tile.x;
}

// Packs four values as half floats: the passes are limited by memory bandwidth.
fn pack_half4(value: vec4<f32>) -> vec2<u32> {
    return vec2(pack2x16float(value.xy), pack2x16float(value.zw));
}

fn unpack_half4(value: vec2<u32>) -> vec4<f32> {
    return vec4(unpack2x16float(value.x), unpack2x16float(value.y));
}

fn linear_step(border: vec2<f32>, coc_px: f32) -> f32 {
    return clamp((coc_px - border.x) * border.y + 0.5, 0.0, 1.0);
}

// Weight of a pixel in a bin. twin: src/bokeh/bin_weight.rs
fn bin_weight(front: vec2<f32>, behind: vec2<f32>, coc_px: f32) -> f32 {
    return linear_step(front, coc_px) - linear_step(behind, coc_px);
}

// Packs a pixel of the scene: light, and CoC as a signed square root, which is finest where bins cross-fade. Light is
// never negative, so the sign of blue marks the farther surface of a mixed pixel.
fn pack_scene(light: vec3<f32>, coc_px: f32, max_px: f32) -> vec2<u32> {
    let root = sign(coc_px) * sqrt(abs(coc_px) / max_px);
    let blue = pack2x16float(vec2(light.b, 0.0)) & ~MIXED_FLAG & 0xffffu;
    return vec2(pack2x16float(light.rg), blue | (pack2x16snorm(vec2(0.0, root)) & 0xffff0000u));
}

fn unpack_scene(value: vec2<u32>, max_px: f32) -> vec4<f32> {
    let root = unpack2x16snorm(value.y).y;
    return vec4(unpack2x16float(value.x), unpack2x16float(value.y & ~MIXED_FLAG).x, root * abs(root) * max_px);
}

// Luminance; all channels share the highlight factor, which preserves the hue.
fn luminance(light: vec3<f32>) -> f32 {
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

// Shared by every pass: the uniforms, with the fields of the Rust structs of the same names, and the numbers that Rust defines.

override CELL: u32;                 // bin pixels a side of a cell
override SEGMENT: u32;              // bin pixels between two edges
override ANY_COLOR: f32;            // no colour is brighter
override COVERAGE_FLOOR: f32;       // less coverage than this has no colour of its own
override FAR_WEIGHT: f32;           // weight of far cells in the local radius
override OTHER_FROM: f32;           // what comes nearer is one surface with what is behind it up to this step of the CoC, and
override OTHER_TO: f32;             // another one from here on
override HIDING_SHARE: f32;         // a bin with this share of a nearer surface shows nothing of what that hides
override HINDMOST_COVERAGE: f32;    // a bin counts wholly from here on when the hindmost is looked for
override GRAIN: u32;                // pixels a side of a cell of the grid of silhouettes
override MARGIN_PX: f32;            // that a silhouette's distances are larger by, as that grid is coarse
override HAND_OVER: f32;            // half the width of the hand-over between two bins, as a share of the border's CoC
override FADE: f32;                 // share of the square of a silhouette's reach, from where it is faded out
override OWN_COVERAGE: f32;         // a surface with less than this does not fill a pixel
override STEPS_ACROSS: u32;         // of the directions in which what hides is looked past, four bits each, 8 more than they are
override STEPS_DOWN: u32;
override MOST_STEPS: u32;           // that are taken
override HALF_ALIKE_PX: f32;        // so far apart, two CoC are half alike
override ONE_SURFACE_PX: f32;       // what is less apart than this is one surface
override TRUSTED_STEPS: f32;        // as long lines are trusted wholly
override ONE_ENDED: f32;            // a line with one end counts as one of so many times its length
override OCTAVES_FROM_PX: f32;      // from this radius on, nodes of the bank lie evenly in each octave
override OCTAVE_SHIFT: u32;         // bits of a float below those that tell the node within its octave

// What a workgroup does, in pixels or whatever the pass goes over: squares, lines, tiles of a bin's rows and of its result.
override TILE: u32;
override SMALL_TILE: u32;
override LINE: u32;
override ROWS_TILE_X: u32;
override ROWS_TILE_Y: u32;
override RESULT_TILE_X: u32;
override RESULT_TILE_Y: u32;
override SHARED_FROM: u32;          // scale of a bin from which on four threads of bin share a pixel

const MAX_BINS = 13;
const MIXED = 0x8000u;      // of a pixel of the scene: see scene_packed

// One frame.
struct Frame {
    size: vec2<u32>,            // columns, rows
    depth_size: vec2<u32>,
    coc_kind: u32,              // 0 uniform, 1 ramp, 2 depth as CoC, 3 depth in metres
    compositing: u32,           // 0 layers, 1 select, 2 gather
    bins: u32,
    near_bins: u32,             // they come first
    reach: u32,                 // of the bank
    nodes: u32,
    groups: u32,                // of four terms each
    most_px: f32,               // no |CoC| is above this
    coc: vec4<f32>,             // uniform: radius; ramp: normal, offset, half band; depth: c_inf, sharp from and to, max
    ramp: vec2<f32>,            // slope, max
    expansion: f32,             // 0: highlights stay as they are
    steps_per_px: f32,          // nodes of the bank per pixel of radius, below OCTAVES_FROM_PX
    mixed: u32,                 // pixels that show two surfaces
    even: u32,                  // 1: taps at -j and j are equal
    extent: f32,                // of the aperture: the outermost point, in radii
    rows_apart: u32,            // pixels filtered at once: from one term's rows to the next one's
    yuyv: u32,                  // 1: the result is YUYV
    front_px: f32,              // what has a CoC above this does not lie in front of the subject
}

// What a dispatch does: some bins, of one layer where it goes over the picture.
struct Work {
    first: u32,                 // bin
    count: u32,                 // of bins
    group: u32,                 // of four terms: which
    terms: u32,                 // how many of them are there
    last: u32,                  // 1: the sum is complete
    nearest_px: f32,            // of the layer: no filled CoC is below this
    unhidden: vec2<f32>,        // of the layer: what counts as not lying in front of it: CoC of the step, slope
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
    binned_at: u32,             // of the flags of its tiles in bin
    reach: u32,                 // outermost tap of any pixel
    filtered_at: u32,           // of the flags of its tiles of rows
    active_at: u32,             // of the flags of its tiles of the result
    has_lobes: u32,             // 1: its results are kept in the range of the colours around
}

fn rows_tile() -> vec2<u32> {
    return vec2(ROWS_TILE_X, ROWS_TILE_Y);
}

fn result_tile() -> vec2<u32> {
    return vec2(RESULT_TILE_X, RESULT_TILE_Y);
}

// A tile that a pixel lies in, row by row.
fn tile_of(pixel: vec2<u32>, width: u32, tile: vec2<u32>) -> u32 {
    return pixel.y / tile.y * ((width + tile.x - 1u) / tile.x) + pixel.x / tile.x;
}

// Four values in half the memory: what is moved is what the passes cost.
fn packed(value: vec4<f32>) -> vec2<u32> {
    return vec2(pack2x16float(value.xy), pack2x16float(value.zw));
}

fn unpacked(value: vec2<u32>) -> vec4<f32> {
    return vec4(unpack2x16float(value.x), unpack2x16float(value.y));
}

fn step_at(border: vec2<f32>, coc_px: f32) -> f32 {
    return clamp((coc_px - border.x) * border.y + 0.5, 0.0, 1.0);
}

// How much of a pixel a bin takes.
fn share_at(front: vec2<f32>, behind: vec2<f32>, coc_px: f32) -> f32 {
    return step_at(front, coc_px) - step_at(behind, coc_px);
}

// A pixel of the scene: light, and CoC as a signed square root, whose steps are fine where bins hand over. Light is never
// negative: the sign of blue says that this is the farther of two surfaces of a mixed pixel.
fn scene_packed(light: vec3<f32>, coc_px: f32, most_px: f32) -> vec2<u32> {
    let root = sign(coc_px) * sqrt(abs(coc_px) / most_px);
    let blue = pack2x16float(vec2(light.b, 0.0)) & ~MIXED & 0xffffu;
    return vec2(pack2x16float(light.rg), blue | (pack2x16snorm(vec2(0.0, root)) & 0xffff0000u));
}

fn scene_unpacked(value: vec2<u32>, most_px: f32) -> vec4<f32> {
    let root = unpack2x16snorm(value.y).y;
    return vec4(unpack2x16float(value.x), unpack2x16float(value.y & ~MIXED).x, root * abs(root) * most_px);
}

// Highlights: all channels share a factor of the luminance, so that the hue stays.
fn luminance(light: vec3<f32>) -> f32 {
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

//! The shaders, and the uniforms and constants that Rust shares with them.

use bytemuck::{Pod, Zeroable};

use crate::bokeh::bank::{EXTRA_TAPS, OCTAVE_SHIFT, OCTAVES_FROM_PX, SPLINE_LEFT};
use crate::bokeh::occlusion::{
    FADE_FRACTION, MARGIN_PX, MIN_OWN_COVERAGE, OTHER_SURFACE_FROM, OTHER_SURFACE_TO, SILHOUETTE_CELL,
};
use crate::bokeh::plan::{
    CELL, CELL_SHARPNESS, HIDING_WEIGHT, HINDMOST_COVERAGE, MIN_CELL_WEIGHT, MIN_COVERAGE, SEGMENT, UNBOUNDED_COLOR,
};
use crate::bokeh::split::CROSS_FADE;
use crate::compute::device::{Shader, shader};

/// Empties the tile lists.
pub const CLEAR: Shader = shader!(blur: "common"; "clear", "list");
/// 8-bit sRGB to linear light, with the CoC.
pub const UNPACK: Shader = shader!(blur: "common"; "unpack", "radii", "silhouette", "cells", "range", "mixed", "list", "tiles", "next", "meet");
/// Dilation of the silhouettes along rows.
pub const DILATE_ROWS: Shader = shader!(blur: "common"; "dilate_rows", "cells");
/// Dilation of the silhouettes down columns.
pub const DILATE_COLUMNS: Shader = shader!(blur: "common"; "dilate_columns", "cells");
/// Weighted pixels of each bin, and the coarse grid over it.
pub const BIN: Shader = shader!(blur: "common"; "bin", "mixed", "tent", "list", "tiles", "todo", "next");
/// Local radius and range of colours.
pub const REACH: Shader = shader!(blur: "common"; "reach", "work");
/// Mean colours of larger cells.
pub const DECIMATE: Shader = shader!(blur: "common"; "decimate", "means", "covered", "work");
/// Colours between the middles of these cells.
pub const INTERPOLATE: Shader = shader!(blur: "common"; "interpolate", "means", "covered", "work");
pub const BLUR_ROWS: Shader =
    shader!(blur: "common"; "blur_rows", "covered", "filter", "node", "list", "tiles", "todo", "next");
pub const BLUR_COLUMNS: Shader =
    shader!(blur: "common"; "blur_columns", "filter", "node", "show", "list", "tiles", "todo");
/// The exact two-dimensional gather.
pub const GATHER: Shader = shader!(blur: "common"; "gather", "node");
/// CoC of the nearest surface.
pub const FIND_OCCLUDERS: Shader = shader!(blur: "common"; "find_occluders", "mixed");
/// Pull-push: the known background at half size and over ever larger areas.
pub const PULL: Shader = shader!(blur: "common"; "pull", "pyramid", "base", "mixed");
/// Pull-push: the coarsest levels, and back.
pub const COARSE: Shader = shader!(blur: "common"; "coarse", "pyramid");
/// Push to the picture.
pub const FILL: Shader =
    shader!(blur: "common"; "fill", "pyramid", "base", "mixed", "cells", "range", "list", "tiles", "next", "meet");
pub const COMPOSITE: Shader = shader!(blur: "common"; "composite", "surfaces", "cells", "list", "yuyv");

pub const ALL: [Shader; 16] = [
    CLEAR,
    UNPACK,
    DILATE_ROWS,
    DILATE_COLUMNS,
    BIN,
    REACH,
    DECIMATE,
    INTERPOLATE,
    BLUR_ROWS,
    BLUR_COLUMNS,
    GATHER,
    FIND_OCCLUDERS,
    PULL,
    COARSE,
    FILL,
    COMPOSITE,
];

/// Invocations of a workgroup in x and in y: for pictures and bins, and for smaller grids.
pub const TILE: u32 = 16;
pub const SMALL_TILE: u32 = 8;
// `fill` computes a tile of the picture from a small one at half size.
const _: () = assert!(TILE == 2 * SMALL_TILE);
// A thread of `unpack` does the pixels of one row of a cell of the silhouettes' grid.
const _: () = assert!(SILHOUETTE_CELL == 4);
/// Invocations of a one-dimensional workgroup.
pub const WORKGROUP_1D: u32 = 256;
/// Sides of segment edges per workgroup of `reach`, two per edge.
pub const EDGES_TILE: [usize; 2] = [TILE as usize, SMALL_TILE as usize];
/// Pixels of a bin per workgroup of `blur_rows`, and of `blur_columns`.
pub const ROWS_TILE: [usize; 2] = [64, 4];
pub const RESULT_TILE: [usize; 2] = [8, 32];

/// Largest number of workgroups that share a list of tiles: more than any device runs at once.
pub const MAX_TILE_WORKGROUPS: usize = 4096;
/// Words of a list before its flags.
pub const LIST_HEAD: usize = 16;
/// Scale of a bin from which four threads share the many taps of a pixel, two per axis.
pub const SHARED_FROM_SCALE: u32 = 4;

/// Values of the `override` constants of `common.wgsl`.
pub const CONSTANTS: [(&str, f64); 27] = [
    ("CELL", CELL as f64),
    ("SEGMENT", SEGMENT as f64),
    ("UNBOUNDED_COLOR", UNBOUNDED_COLOR as f64),
    ("MIN_COVERAGE", MIN_COVERAGE as f64),
    ("MIN_CELL_WEIGHT", MIN_CELL_WEIGHT as f64),
    ("OTHER_SURFACE_FROM", OTHER_SURFACE_FROM as f64),
    ("OTHER_SURFACE_TO", OTHER_SURFACE_TO as f64),
    ("HIDING_WEIGHT", HIDING_WEIGHT as f64),
    ("HINDMOST_COVERAGE", HINDMOST_COVERAGE as f64),
    ("SILHOUETTE_CELL", SILHOUETTE_CELL as f64),
    ("MARGIN_PX", MARGIN_PX as f64),
    ("CROSS_FADE", CROSS_FADE as f64),
    ("FADE_FRACTION", FADE_FRACTION as f64),
    ("MIN_OWN_COVERAGE", MIN_OWN_COVERAGE as f64),
    ("OCTAVES_FROM_PX", OCTAVES_FROM_PX as f64),
    ("OCTAVE_SHIFT", OCTAVE_SHIFT as f64),
    ("SPLINE_LEFT", SPLINE_LEFT as f64),
    ("CELL_SHARPNESS", CELL_SHARPNESS as f64),
    ("EXTRA_TAPS", EXTRA_TAPS as f64),
    ("TILE", TILE as f64),
    ("SMALL_TILE", SMALL_TILE as f64),
    ("WORKGROUP_1D", WORKGROUP_1D as f64),
    ("ROWS_TILE_X", ROWS_TILE[0] as f64),
    ("ROWS_TILE_Y", ROWS_TILE[1] as f64),
    ("RESULT_TILE_X", RESULT_TILE[0] as f64),
    ("RESULT_TILE_Y", RESULT_TILE[1] as f64),
    ("SHARED_FROM_SCALE", SHARED_FROM_SCALE as f64),
];

/// Uniform `Frame` of `common.wgsl`, where the fields are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Frame {
    pub size: [u32; 2],
    pub depth_size: [u32; 2],
    pub coc_kind: u32,
    pub compositing: u32,
    pub bins: u32,
    pub near_bins: u32,
    pub half_width: u32,
    pub nodes: u32,
    pub groups: u32,
    pub max_px: f32,
    pub coc: [f32; 4],
    pub ramp: [f32; 2],
    pub expansion: f32,
    pub steps_per_px: f32,
    pub mixed: u32,
    pub symmetric: u32,
    pub extent: f32,
    pub term_stride: u32,
    pub yuyv: u32,
    pub front_px: f32,
    pub has_reduced: u32,
    /// Padding to the size of the uniform.
    pub unused: u32,
}

/// Uniform `Bin` of `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Bin {
    pub size: [u32; 2],
    pub cells: [u32; 2],
    pub scale: u32,
    pub edges: u32,
    pub decimation: u32,
    pub whole: u32,
    pub front: [f32; 2],
    pub behind: [f32; 2],
    pub max_radius_px: f32,
    pub sigma_cells: f32,
    pub radius_cells: u32,
    pub pixels_at: u32,
    pub rows_at: u32,
    pub edges_at: u32,
    pub cells_at: u32,
    pub binned_at: u32,
    pub half_width: u32,
    pub filtered_at: u32,
    pub active_at: u32,
    pub has_overshoot: u32,
}

/// Uniform `Work` of `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Work {
    pub first: u32,
    pub count: u32,
    pub group: u32,
    pub terms: u32,
    pub last: u32,
    pub nearest_px: f32,
    pub visible_weight: [f32; 2],
}

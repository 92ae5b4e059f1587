// Shared by the passes of pull-push inpainting (Gortler et al., The Lumigraph, 1996), over a pyramid from half the size
// of the picture (level 0) to one pixel. A pixel stores light and CoC times the known weight, and that weight. Level 0
// is recomputed instead of stored.
// twin: src/bokeh/cpu/levels.rs

// Levels above level 0 that are computed tile by tile; one workgroup does all others.
const TILED_LEVELS = 5u;

struct Level {
    size: vec2<u32>,
    at: u32,            // offset of its pixels among those of all levels
}

struct Known {
    value: vec4<f32>,
    known: f32,
}

// Size of level 0.
fn finest_size() -> vec2<u32> {
    return (frame.size + 1u) / 2u;
}

fn coarser_level(level: Level) -> Level {
    return Level((level.size + 1u) / 2u, level.at + level.size.x * level.size.y);
}

// A level, from 1 on.
fn pyramid_level(number: u32) -> Level {
    var level = Level((finest_size() + 1u) / 2u, 0u);
    for (var k = 1u; k < number; k++) {
        level = coarser_level(level);
    }
    return level;
}

fn is_coarsest(size: vec2<u32>) -> bool {
    return all(size == vec2(1u));
}

fn pixel_index(level: Level, pixel: vec2<u32>) -> u32 {
    return level.at + pixel.y * level.size.x + pixel.x;
}

fn plus(a: Known, b: Known) -> Known {
    return Known(a.value + b.value, a.known + b.known);
}

fn times(a: Known, factor: f32) -> Known {
    return Known(a.value * factor, a.known * factor);
}

// Pull: combines four pixels into one of the coarser level, divided by the known weight if that is above 1.
fn pull_sum(sum: Known) -> Known {
    return times(sum, 1.0 / max(sum.known, 1.0));
}

// Push: fills the unknown part of a pixel from the coarser level.
fn push_into(own: Known, around: Known) -> Known {
    return plus(own, times(around, (1.0 - own.known) / max(around.known, 1.0e-6)));
}

// The coarse neighbour that a fine pixel is interpolated with, along one axis.
fn coarse_neighbour(at: u32, limit: u32) -> u32 {
    let half = at / 2u;
    return select(min(half + 1u, limit - 1u), half - min(half, 1u), at % 2u == 0u);
}

// The four coarse pixels for bilinear interpolation: near and far column, near and far row.
fn neighbour_pixels(pixel: vec2<u32>, coarse: vec2<u32>) -> vec4<u32> {
    return vec4(pixel.x / 2u, coarse_neighbour(pixel.x, coarse.x), pixel.y / 2u, coarse_neighbour(pixel.y, coarse.y));
}

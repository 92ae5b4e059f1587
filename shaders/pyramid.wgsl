// Shared by the passes of push-pull inpainting, over a pyramid from half the size of the picture (level 0) to one pixel. Of
// each pixel it has light and CoC times how far they are known, and that. Level 0 is not kept: it is soon made anew.

// So many levels above level 0 are done tile by tile, and all others by one workgroup.
const BY_TILES = 5u;

struct Level {
    size: vec2<u32>,
    at: u32,            // of its pixels among those of all levels
}

struct Known {
    value: vec4<f32>,
    known: f32,
}

// Size of level 0.
fn finest() -> vec2<u32> {
    return (frame.size + 1u) / 2u;
}

fn coarser(level: Level) -> Level {
    return Level((level.size + 1u) / 2u, level.at + level.size.x * level.size.y);
}

// A level from 1 on.
fn level_of(number: u32) -> Level {
    var level = Level((finest() + 1u) / 2u, 0u);
    for (var k = 1u; k < number; k++) {
        level = coarser(level);
    }
    return level;
}

fn is_coarsest(size: vec2<u32>) -> bool {
    return all(size == vec2(1u));
}

fn index_of(level: Level, pixel: vec2<u32>) -> u32 {
    return level.at + pixel.y * level.size.x + pixel.x;
}

fn plus(a: Known, b: Known) -> Known {
    return Known(a.value + b.value, a.known + b.known);
}

fn times(a: Known, factor: f32) -> Known {
    return Known(a.value * factor, a.known * factor);
}

// The sum of four pixels: of those in front of the subject or of the others, whichever are better known, and in a tie those in
// front. Means of both would be a colour and a CoC that is in neither.
fn one_side(four: array<Known, 4>) -> Known {
    var sides = array<Known, 2>(Known(vec4(0.0), 0.0), Known(vec4(0.0), 0.0));
    var all = four;
    for (var k = 0u; k < 4u; k++) {
        if all[k].value.w < frame.front_px * all[k].known {
            sides[0] = plus(sides[0], all[k]);
        } else {
            sides[1] = plus(sides[1], all[k]);
        }
    }
    if sides[0].known > 0.99 * sides[1].known {
        return sides[0];
    }
    return sides[1];
}

// Four pixels as one of the coarser level: their mean where more than one is known.
fn pulled(four: array<Known, 4>) -> Known {
    let sum = one_side(four);
    return times(sum, 1.0 / max(sum.known, 1.0));
}

// What a pixel does not know, from the four of the coarser level around it: the one that covers it, the neighbours across and
// down, and the one across from both.
fn pushed(own: Known, around: array<Known, 4>) -> Known {
    var weighed = around;
    weighed[0] = times(around[0], 9.0 / 16.0);
    weighed[1] = times(around[1], 3.0 / 16.0);
    weighed[2] = times(around[2], 3.0 / 16.0);
    weighed[3] = times(around[3], 1.0 / 16.0);
    let sum = one_side(weighed);
    return plus(own, times(sum, (1.0 - own.known) / max(sum.known, 1.0e-6)));
}

// The other coarse pixel that a fine one lies between, along one axis.
fn neighbour(at: u32, limit: u32) -> u32 {
    let half = at / 2u;
    return select(min(half + 1u, limit - 1u), half - min(half, 1u), at % 2u == 0u);
}

// The four coarse pixels that a fine one lies between: columns of the nearer and the farther, rows likewise.
fn between(pixel: vec2<u32>, coarse: vec2<u32>) -> vec4<u32> {
    return vec4(pixel.x / 2u, neighbour(pixel.x, coarse.x), pixel.y / 2u, neighbour(pixel.y, coarse.y));
}

//! Which edge pixels stay if there are more than the budget: those whose size of step the fewest pixels have.
//! twin: shaders/matte/rank.wgsl, matte/count.wgsl

use std::cmp::Reverse;

use super::EdgePixel;
use crate::depth::bitmap::Bitmap;

/// Sizes of step: half octaves, from the smallest one on.
pub const SIZES: usize = 32;
/// Number of bits of an f32 below those of its half octave.
pub const BITS_BELOW_SIZE: u32 = f32::MANTISSA_DIGITS - 2;

/// Keeps at most `most` of the `edges`, all larger than `depth_step`, and in `at_edge` only those. What is nearly
/// everywhere, noise or a wire mesh, goes first, and sizes stay or go whole, so that no outline is dotted. Returns
/// whether all stayed.
pub fn keep_rarest_steps(edges: &mut Vec<EdgePixel>, at_edge: &mut Bitmap, depth_step: f32, most: usize) -> bool {
    if edges.len() <= most {
        return true;
    }
    let half_octave = |step: f32| (step.to_bits() >> BITS_BELOW_SIZE) as usize;
    let least = half_octave(depth_step);
    let size_of = |edge: &EdgePixel| (half_octave(edge.near - edge.far) - least).min(SIZES - 1);
    let mut counts = [0; SIZES];
    edges.iter().for_each(|edge| counts[size_of(edge)] += 1);
    // Of sizes that are as rare, the larger one is kept first.
    let rarity = |size: usize| (counts[size], Reverse(size));
    let is_kept: [bool; SIZES] = std::array::from_fn(|size| {
        (0..SIZES).filter(|&other| rarity(other) <= rarity(size)).map(|other| counts[other]).sum::<usize>() <= most
    });
    edges.retain(|edge| {
        let stays = is_kept[size_of(edge)];
        if !stays {
            at_edge.unset(edge.x as usize, edge.y as usize);
        }
        stays
    });
    false
}

//! Pairs two lists of pictures by nearest time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::contents::PictureSource;
use super::list::Entry;
use super::timeline;

/// The list of a time, and its index there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Stream {
    Color(usize),
    Depth(usize),
}

/// Entries with their counterparts.
pub(super) struct Paired {
    /// Pairs, and entries without a time, which stay as frames that fail to read.
    pub(super) frames: Vec<(Entry, Option<PictureSource>)>,
    /// Number of unpaired entries of the first list.
    pub(super) unpaired: usize,
    /// Number of unpaired entries of the second list.
    pub(super) unpaired_others: usize,
}

/// Pairs two lists with [`pair_nearest`]. Entries with a time but no counterpart are counted and dropped.
pub(super) fn pair_by_time(entries: Vec<Entry>, others: Vec<Entry>, tolerance_ns: u64) -> Paired {
    let times = |entries: &[Entry]| entries.iter().filter_map(|entry| entry.time_ns).collect::<Vec<_>>();
    let mut partners = pair_nearest(&times(&entries), &times(&others), tolerance_ns).into_iter();

    let mut paired = Paired { frames: Vec::new(), unpaired: 0, unpaired_others: others.len() };
    // `pair_nearest` sees only entries with a time.
    let mut timed: Vec<_> =
        others.into_iter().filter(|other| other.time_ns.is_some()).map(|other| Some(other.source)).collect();
    for entry in entries {
        let partner = match entry.time_ns {
            Some(_) => partners.next().flatten().and_then(|partner| timed[partner].take()),
            None => None,
        };
        if entry.time_ns.is_some() && partner.is_none() {
            paired.unpaired += 1;
        } else {
            paired.unpaired_others -= usize::from(partner.is_some());
            paired.frames.push((entry, partner));
        }
    }
    paired
}

/// Pairs pictures with the depth maps that were taken within half a frame. Returns the positions of both in their strictly
/// increasing lists of times; without depth, all pictures.
pub(super) fn pair_frames(color_ns: &[u64], depth_ns: Option<&[u64]>) -> Vec<(usize, Option<usize>)> {
    let Some(depth_ns) = depth_ns else { return (0..color_ns.len()).map(|color| (color, None)).collect() };
    let tolerance_ns = timeline::median_period_ns(color_ns.iter().copied()) / 2;
    let partners = pair_nearest(color_ns, depth_ns, tolerance_ns).into_iter().enumerate();
    partners.filter_map(|(color, depth)| Some((color, Some(depth?)))).collect()
}

/// Pairs two strictly increasing lists of times greedily, the closest pair first, each time at most once, as the TUM
/// benchmark's `associate.py` does. Returns the counterpart of each colour time.
///
/// In merged order the closest two times of different lists are always neighbours, so only neighbours are candidates:
/// `n log n` for any tolerance.
pub(super) fn pair_nearest(color_ns: &[u64], depth_ns: &[u64], tolerance_ns: u64) -> Vec<Option<usize>> {
    let colors = color_ns.iter().enumerate().map(|(index, &time)| (time, Stream::Color(index)));
    let depths = depth_ns.iter().enumerate().map(|(index, &time)| (time, Stream::Depth(index)));
    let mut merged: Vec<_> = colors.chain(depths).collect();
    merged.sort_unstable();

    // A linked list of the times not paired yet; its ends point outside `merged`.
    let len = merged.len();
    let mut before: Vec<usize> = (0..len).map(|at| at.wrapping_sub(1)).collect();
    let mut after: Vec<usize> = (1..=len).collect();

    let candidate = |left: usize, right: usize| {
        let (&(left_ns, left_of), &(right_ns, right_of)) = (merged.get(left)?, merged.get(right)?);
        let (color, depth) = match (left_of, right_of) {
            (Stream::Color(color), Stream::Depth(depth)) | (Stream::Depth(depth), Stream::Color(color)) => {
                (color, depth)
            }
            _ => return None,
        };
        let gap_ns = right_ns - left_ns;
        // Indices break ties as the benchmark's tool does.
        (gap_ns <= tolerance_ns).then_some(Reverse((gap_ns, color, depth, left, right)))
    };
    let mut candidates: BinaryHeap<_> = (1..len).filter_map(|right| candidate(right - 1, right)).collect();

    let mut partners = vec![None; color_ns.len()];
    let mut is_paired = vec![false; len];
    while let Some(Reverse((_, color, depth, left, right))) = candidates.pop() {
        if is_paired[left] || is_paired[right] {
            continue;
        }
        partners[color] = Some(depth);
        (is_paired[left], is_paired[right]) = (true, true);
        // The neighbours of the pair become neighbours of each other.
        let (outer_left, outer_right) = (before[left], after[right]);
        if let Some(next) = after.get_mut(outer_left) {
            *next = outer_right;
        }
        if let Some(previous) = before.get_mut(outer_right) {
            *previous = outer_left;
        }
        candidates.extend(candidate(outer_left, outer_right));
    }
    partners
}

#[cfg(test)]
mod tests {
    use super::pair_nearest;

    /// Reference: the benchmark's algorithm, all pairs within the tolerance, sorted, taken greedily.
    fn all_pairs(color_ns: &[u64], depth_ns: &[u64], tolerance_ns: u64) -> Vec<Option<usize>> {
        let mut pairs: Vec<_> = (0..color_ns.len())
            .flat_map(|color| (0..depth_ns.len()).map(move |depth| (color, depth)))
            .map(|(color, depth)| (color_ns[color].abs_diff(depth_ns[depth]), color, depth))
            .filter(|&(gap_ns, ..)| gap_ns <= tolerance_ns)
            .collect();
        pairs.sort_unstable();
        let mut partners = vec![None; color_ns.len()];
        for (_, color, depth) in pairs {
            if partners[color].is_none() && !partners.contains(&Some(depth)) {
                partners[color] = Some(depth);
            }
        }
        partners
    }

    #[test]
    fn agrees_with_the_greedy_search_over_all_pairs() {
        let mut state = 1_u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for _ in 0..500 {
            let mut times = |count: u64| {
                let mut times: Vec<_> = (0..random(count)).map(|_| random(60)).collect();
                times.sort_unstable();
                times.dedup();
                times
            };
            let (color_ns, depth_ns) = (times(20), times(20));
            for tolerance_ns in [0, 1, 3, 10, u64::MAX] {
                assert_eq!(
                    pair_nearest(&color_ns, &depth_ns, tolerance_ns),
                    all_pairs(&color_ns, &depth_ns, tolerance_ns),
                    "{color_ns:?} {depth_ns:?} within {tolerance_ns}"
                );
            }
        }
    }
}

//! The meaning of a map's numbers: what the caller says, else the file, else its content, as far as it is unmistakable.

use super::values::{Samples, Values};
use super::{DepthFile, DepthUnit, Distances, Options};
use crate::recording::fault::PictureFault;
use crate::recording::role::Role;
use crate::recording::tum;
use crate::recording::unit::MapUnit;
use bokehcam::frame::{DepthMap, DisparityMap};
use bokehcam::optics::StereoRig;

/// What the numbers are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Meaning {
    quantity: Quantity,
    distances: Distances,
    notes: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Quantity {
    Depth { per_m: f32 },
    Inverse,
    Disparity { per_px: f32, rig: Option<StereoRig> },
}

/// No scene that a camera sees is deeper, but for its sky.
const MAX_PLAUSIBLE_M: f32 = 1000.0;
/// Fraction of the pixels farther away that still counts as noise.
const MAX_IMPLAUSIBLE: f32 = 0.005;
/// Share of a range under which no camera sees: 26 cm of 16 bits in the default unit, and 2 cm of a metre.
const NEAR: f32 = 0.02;
/// Minimum occupied bins, of a histogram with 256, of a 16-bit map that was stretched to the full range.
const STRETCHED: usize = 256 * 3 / 10;
/// Number of different values of 8 bits from which on a map is no sketch of a few surfaces.
const MIN_STEPS: usize = 16;
/// Fraction of unknown depth above which it is reported.
const MAX_UNKNOWN: f32 = 0.05;

impl Meaning {
    /// Decides what the numbers mean.
    ///
    /// # Errors
    /// It is not stated, and they may be distances or nearness.
    pub fn decide(values: &Values, options: &Options) -> Result<Self, PictureFault> {
        let mut notes = Vec::new();
        let is_inverse = options.invert || options.unit.is_none() && values.role == Role::InverseDepth;
        let unit = options.unit.or(is_inverse.then_some(DepthUnit::Inverse));
        let without_scale = |notes: &mut Vec<String>, what: &str| {
            if options.scale.is_some() {
                notes.push(format!("{what}; --depth-scale does not apply to it"));
            }
        };
        let (quantity, distances) = match (unit, values.stated) {
            (Some(DepthUnit::Inverse), _) => {
                if !options.invert {
                    notes.push("the largest values are taken as near; --depth-invert takes them as far".to_owned());
                }
                (Quantity::Inverse, Distances::Relative)
            }
            (Some(DepthUnit::PerMetre(per_m)), _) => (Quantity::Depth { per_m }, Distances::Metres),
            (Some(DepthUnit::Disparity), stated) | (None, stated @ Some(MapUnit::Disparity { .. })) => {
                without_scale(&mut notes, "contains disparity");
                let rig = stated.and_then(|stated| stated.rig());
                if rig.is_none() {
                    notes.push(
                        "contains disparity without a scale: the order of depth is known, distances are not".to_owned(),
                    );
                }
                let distances = if rig.is_some() { Distances::Metres } else { Distances::Relative };
                (Quantity::Disparity { per_px: values.disparities_per_px(), rig }, distances)
            }
            (Some(DepthUnit::Metres) | None, stated) => {
                let per_m = match (values.samples, stated, options.scale) {
                    (Samples::Float, _, _) => {
                        without_scale(&mut notes, "contains floats, in metres");
                        1.0
                    }
                    (Samples::Eight, _, _) => return Err(PictureFault::CoarseDepth),
                    (_, Some(MapUnit::Depth { per_m }), Some(given)) if given != per_m => {
                        notes.push(format!("states {per_m} units per metre, but is read with {given}, as requested"));
                        given
                    }
                    (_, _, Some(given)) => given,
                    (_, Some(MapUnit::Depth { per_m }), None) => per_m,
                    (Samples::Sixteen, _, None) => tum::DEPTH_SCALE,
                    (Samples::Whole, _, None) => {
                        return Err(PictureFault::UnclearDepth("whole numbers of an unknown unit"));
                    }
                };
                if unit.is_none() && stated.is_none() && options.scale.is_none() {
                    check_unclear(values).map_or(Ok(()), |what| Err(PictureFault::UnclearDepth(what)))?;
                }
                let is_sure = values.samples == Samples::Float;
                (Quantity::Depth { per_m }, if is_sure { Distances::Metres } else { Distances::Scaled })
            }
        };
        Ok(Self { quantity, distances, notes })
    }

    /// Converts the numbers to depth.
    pub fn into_depth(self, values: Values, options: &Options) -> DepthFile {
        let range = options.range.or_else(|| self.range_of(&values, options));
        let is_known = self.known(find_invalid(&values, options));
        let Self { quantity, distances, mut notes } = self;
        notes.splice(..0, values.notes);
        let (width, height) = values.size;
        let mut numbers = values.numbers;
        let map = match quantity {
            Quantity::Depth { per_m } => {
                for number in &mut numbers {
                    // Infinity is how renderers write what they never hit: the farthest there is.
                    let far = if *number > 0.0 { DepthMap::MAX_M } else { 0.0 };
                    let metres = *number / per_m;
                    let metres = if metres <= DepthMap::MAX_M { metres } else { far };
                    *number = if is_known(*number) && DepthMap::is_known(metres) { metres } else { 0.0 };
                }
                DepthMap { width, height, metres: numbers, ..DepthMap::default() }
            }
            Quantity::Inverse => {
                let (low, high) = range.unwrap_or_default();
                let scale = 1.0 / (high - low).max(f32::MIN_POSITIVE);
                for number in &mut numbers {
                    let near = (*number - low) * scale;
                    let near = if options.invert { 1.0 - near } else { near };
                    *number = if is_known(*number) { DepthMap::relative_to_metres(near) } else { 0.0 };
                }
                DepthMap { width, height, metres: numbers, ..DepthMap::default() }
            }
            Quantity::Disparity { per_px, rig } => {
                // Without a scale, the nearest is where relative depth has it.
                let nearest = range.map_or(1.0, |(_, nearest)| nearest) / per_px;
                let depth_m = |px| rig.map_or(DepthMap::SUBJECT_M * nearest / px, |rig| rig.depth_m(px));
                numbers.iter_mut().for_each(|number| *number = if is_known(*number) { *number / per_px } else { 0.0 });
                DisparityMap { width, height, px: numbers }.to_depth_map(depth_m)
            }
        };
        let unknown = map.metres.iter().filter(|&&metres| metres == 0.0).count() as f32 / map.metres.len() as f32;
        if unknown > MAX_UNKNOWN {
            notes.push(format!("depth is unknown in {:.0} % of it, and is filled in", 100.0 * unknown));
        }
        DepthFile { map, distances, notes }
    }

    /// Returns the test of whether a number is known.
    fn known(&self, invalid: Option<f32>) -> impl Fn(f32) -> bool + use<> {
        let is_inverse = self.quantity == Quantity::Inverse;
        move |number| Some(number) != invalid && (number.is_finite() || !is_inverse)
    }

    /// Returns the numbers of relative depth between which it lies; `None` for depth in metres.
    pub fn range_of(&self, values: &Values, options: &Options) -> Option<(f32, f32)> {
        let is_known = self.known(find_invalid(values, options));
        let known = || values.numbers.iter().copied().filter(|&number| is_known(number));
        match self.quantity {
            Quantity::Inverse => Some(range_of(known())),
            Quantity::Disparity { rig: None, .. } => {
                nearest(known().filter(|&number| DepthMap::is_known(number)).collect()).map(|nearest| (0.0, nearest))
            }
            Quantity::Depth { .. } | Quantity::Disparity { .. } => None,
        }
    }
}

/// Returns the number that means unknown: the one given, or the one stated; 0 is the default of what is given,
/// and states nothing.
fn find_invalid(values: &Values, options: &Options) -> Option<f32> {
    options.invalid.filter(|&invalid| invalid != 0.0).or(values.invalid)
}

/// Returns the inverse depth that counts as the nearest, of known ones: a few outliers are nearer.
pub(super) fn nearest(mut inverse: Vec<f32>) -> Option<f32> {
    const OUTLIERS: f32 = 0.01;
    let at = (OUTLIERS * inverse.len() as f32) as usize;
    (!inverse.is_empty()).then(|| *inverse.select_nth_unstable_by(at, |a, b| b.total_cmp(a)).1)
}

/// Returns what is wrong with numbers that would be taken as distances, as nothing else is stated.
fn check_unclear(values: &Values) -> Option<&'static str> {
    let is_known = |number: &f32| number.is_finite() && Some(*number) != values.invalid;
    let known = || values.numbers.iter().copied().filter(is_known);
    let (low, high) = range_of(known());
    match values.samples {
        Samples::Sixteen => {
            let mut ranges = [false; 256];
            known().for_each(|number| ranges[usize::from(number as u16 >> 8)] = true);
            let count = ranges.iter().filter(|range| **range).count();
            // What a sensor does not see it writes as 0 or 65535, so that neither alone means anything.
            let is_whole = low == 0.0 && high == 65535.0 || fills(known(), 65535.0);
            let is_stretched = is_whole && count >= STRETCHED && ranges[240..255].contains(&true);
            // 8 bits become 16 by either factor.
            let is_coarse = [256, 257].iter().any(|step| known().all(|number| (number as u32).is_multiple_of(*step)));
            if is_stretched {
                Some("numbers stretched from 0 to 65535")
            } else {
                (is_coarse && count >= MIN_STEPS).then_some("8 bits stretched to 16")
            }
        }
        Samples::Float if (low, high) == (0.0, 1.0) || fills(known(), 1.0) => Some("numbers stretched from 0 to 1"),
        Samples::Float if (low, high) == (0.0, 255.0) && known().all(|number| number.fract() == 0.0) => {
            Some("whole numbers from 0 to 255")
        }
        Samples::Float => {
            // A sky has one distance, however large.
            let is_far = |number: f32| number > MAX_PLAUSIBLE_M && number < high;
            let far = known().filter(|&number| is_far(number)).count();
            (far as f32 > MAX_IMPLAUSIBLE * values.numbers.len() as f32)
                .then_some("distances of more than a kilometre, if they are metres")
        }
        Samples::Eight | Samples::Whole => None,
    }
}

/// Returns whether numbers fill the range from 0 to `white` nearly, as those of a map that was stretched and then scaled in
/// size do: no distances, as then some are nearer than a camera sees.
fn fills(numbers: impl Iterator<Item = f32> + Clone, white: f32) -> bool {
    let share = |count: usize| count as f32 > MAX_IMPLAUSIBLE * numbers.clone().count() as f32;
    let (_, high) = range_of(numbers.clone());
    let near = numbers.clone().filter(|&number| number > 0.0 && number < NEAR * white).count();
    (0.95 * white..=1.05 * white).contains(&high) && share(near)
}

/// Returns the smallest and the largest of the numbers.
fn range_of(numbers: impl Iterator<Item = f32>) -> (f32, f32) {
    numbers.fold((f32::MAX, f32::MIN), |(low, high), number| (low.min(number), high.max(number)))
}

/// Rejects maps that tell nothing. If the file states its unit, it may be flat, as walls are.
pub(super) fn check_usable(map: &DepthMap, is_stated: bool) -> Result<(), PictureFault> {
    let mut known = map.metres.iter().copied().filter(|&metres| DepthMap::is_known(metres));
    let first = known.next().ok_or(PictureFault::NoDepth("no depth is known anywhere in it"))?;
    if !is_stated && known.all(|metres| metres == first) {
        return Err(PictureFault::NoDepth("it has one value all over, so nothing is nearer than the rest"));
    }
    Ok(())
}

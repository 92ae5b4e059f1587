//! Foreground segmentation: pixels that differ from the plate, except changes of light, as connected components.

use crate::depth::alignment::Alignment;
use crate::depth::dilation::dilate;
use crate::depth::reduced::MAX_VALUE;
use crate::depth::tap::nearest_index;
use crate::frame::Mask;

/// Hysteresis thresholds of the difference, for low noise: possible foreground, and certain foreground.
const WEAK: f32 = 6.0;
const STRONG: f32 = 13.0;
/// Thresholds for high noise, in standard deviations.
const WEAK_DEVIATIONS: f32 = 4.0;
const STRONG_DEVIATIONS: f32 = 8.0;
/// Upper bound of the noise's standard deviation in a reduced pixel.
const MAX_DEVIATION: f32 = 3.0;
/// Factor of the thresholds for pixels that were foreground in the previous frame (hysteresis).
const HYSTERESIS: f32 = 0.75;
/// Minimum ratio of a shadow's value (root of light) to the plate's, and maximum deviation from the plate's colour.
const MIN_SHADOW_RATIO: f32 = 0.72;
const MAX_SHADOW_TINT: f32 = 4.0;
/// Ratios of values under a lamp that was switched on: minimum and maximum per channel, and maximum between channels.
const MIN_LIT_RATIO: f32 = 0.98;
const MAX_LIT_RATIO: f32 = 1.8;
const MAX_LIT_TINT: f32 = 1.25;
/// Maximum change of the ratio between neighbours under changed light; outlines exceed it.
const MAX_LIGHT_GRADIENT: f32 = 0.035;
/// Minimum size of a component, as a fraction of the picture.
const MIN_COMPONENT: f32 = 0.002;
/// Holes up to this fraction of the picture are filled.
const MAX_HOLE: f32 = 0.001;

/// Minimum mask value of a person; radius around persons that belongs to them, as a fraction of the mask's width; and
/// maximum size of objects attached to them, such as held ones, relative to them.
const MIN_PERSON_ALPHA: f32 = 0.5;
const CLOSE_FRACTION: f32 = 0.02;
const MAX_HELD: f32 = 0.3;

/// Label of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Label {
    Background,
    /// Background in a shadow or under other light.
    Relit,
    /// Possible foreground.
    Weak,
    Strong,
}

/// A connected component of the foreground.
#[derive(Clone, Copy, Debug)]
pub struct Component {
    /// Its range in [`Subject::pixels`].
    pub first: usize,
    pub end: usize,
}

/// Computes the differences of a row from the plate, three values a pixel. Shifts by up to half a pixel are tolerated:
/// values between the plate's pixel and its neighbours (`beside`: above and below; left and right from `own`) are no
/// difference. The plate's values are multiplied by `gain`.
fn compute_differences(now: &[f32], own: &[f32], beside: [&[f32]; 2], gain: &[f32], off: &mut [f32]) {
    let count = off.len();
    let off_at = |value: f32, own: f32, around: [f32; 4], gain: f32| {
        let halves = around.map(|beside| 0.5 * (own + beside));
        let low = halves.into_iter().fold(own, f32::min);
        let high = halves.into_iter().fold(own, f32::max);
        // The plate may be clipped at white: brighter values are no difference.
        ((gain * low).min(MAX_VALUE) - value).max(value - (gain * high).min(MAX_VALUE))
    };
    let [above, below] = beside.map(|row| &row[..count]);
    let (now, own, gain) = (&now[..count], &own[..count], &gain[..count]);
    for k in 3..count.max(6) - 3 {
        off[k] = off_at(now[k], own[k], [own[k - 3], own[k + 3], above[k], below[k]], gain[k]);
    }
    // The first and the last pixel have one neighbour in the row.
    for k in (0..count.min(3)).chain(count.saturating_sub(3).max(3)..count) {
        let (left, right) = (own[if k < 3 { k } else { k - 3 }], own[if k + 3 < count { k + 3 } else { k }]);
        off[k] = off_at(now[k], own[k], [left, right, above[k], below[k]], gain[k]);
    }
}

/// Segments the foreground; owns the memory for it.
#[derive(Debug, Default)]
pub struct Subject {
    labels: Vec<Label>,
    /// Per row, three values a pixel: gain, and difference from the plate.
    line: Vec<f32>,
    off: Vec<f32>,
    /// Ratio of each pixel's brightness to the plate's.
    ratios: Vec<f32>,
    seen: Vec<bool>,
    front: Vec<u32>,
    sample: Vec<f32>,
    /// Scratch memory for dilation.
    flags: Vec<bool>,
    /// Whether a pixel of the persons' mask is in or close to a person.
    near: Vec<bool>,
    /// Whether a pixel is foreground.
    pub foreground: Vec<bool>,
    /// The pixels of all components, one after the other.
    pub pixels: Vec<u32>,
    pub components: Vec<Component>,
}

impl Subject {
    /// Returns the fraction of the picture that is foreground.
    pub fn foreground_fraction(&self) -> f32 {
        self.pixels.len() as f32 / self.foreground.len().max(1) as f32
    }

    /// Segments a picture against its plate. `foreground` contains the previous frame's foreground on entry, for the
    /// hysteresis, and the new one on return.
    pub fn segment(&mut self, now: &[[f32; 3]], plate: &[[f32; 3]], size: (usize, usize), alignment: &Alignment) {
        let deviation = self.estimate_noise(now, plate, alignment);
        let weak = WEAK.max(WEAK_DEVIATIONS * deviation);
        let strong = STRONG.max(STRONG_DEVIATIONS * deviation);
        self.label_pixels(now, plate, size, alignment.gain, weak, strong);
        self.grow_relit_background(size);
        self.find_components(size);
        self.fill_holes(size);
    }

    /// Estimates the noise's standard deviation by the median absolute deviation of the background pixels.
    fn estimate_noise(&mut self, now: &[[f32; 3]], plate: &[[f32; 3]], alignment: &Alignment) -> f32 {
        /// Median absolute deviation of a normal distribution, in standard deviations.
        const MEDIAN: f32 = 0.6745;
        self.sample.clear();
        let all = now.iter().zip(plate).zip(&self.foreground).filter(|(_, foreground)| !**foreground);
        // A sample suffices.
        self.sample.extend(all.step_by(5).map(|((now, plate), _)| (now[1] - alignment.gain[1] * plate[1]).abs()));
        let middle = self.sample.len() / 2;
        match self.sample.is_empty() {
            true => 0.0,
            false => (*self.sample.select_nth_unstable_by(middle, f32::total_cmp).1 / MEDIAN).min(MAX_DEVIATION),
        }
    }

    /// Labels each pixel by its largest difference from the plate with the exposure `gain`. `weak` and `strong` are the
    /// thresholds; foreground of the previous frame stays foreground down to a fraction of them (hysteresis).
    fn label_pixels(
        &mut self,
        now: &[[f32; 3]],
        plate: &[[f32; 3]],
        (width, height): (usize, usize),
        gain: [f32; 3],
        weak: f32,
        strong: f32,
    ) {
        self.labels.clear();
        self.ratios.clear();
        self.foreground.resize(now.len(), false);
        let (now, plate) = (now.as_flattened(), plate.as_flattened());
        let line = 3 * width;
        self.line.clear();
        self.line.extend((0..width).flat_map(|_| gain));
        self.off.resize(line, 0.0);
        for y in 0..height {
            let row = |y: usize| &plate[y * line..][..line];
            let (plate_row, now_row) = (row(y), &now[y * line..][..line]);
            let beside = [row(y.saturating_sub(1)), row((y + 1).min(height - 1))];
            compute_differences(now_row, plate_row, beside, &self.line, &mut self.off);
            for x in 0..width {
                let (at, of) = (y * width + x, 3 * x..3 * x + 3);
                let (values, off) = (&now_row[of.clone()], &self.off[of.clone()]);
                let exposed: [f32; 3] = std::array::from_fn(|p| gain[p] * plate_row[3 * x + p]);
                let ratio = (values.iter().sum::<f32>() + 1.0) / (exposed.iter().sum::<f32>() + 1.0);
                self.ratios.push(ratio);
                let most = off[0].max(off[1]).max(off[2]).max(0.0);
                let stays = if self.foreground[at] { HYSTERESIS } else { 1.0 };
                // A shadow darkens all channels alike, and a lamp brightens them by similar factors.
                let in_shadow = || {
                    let off = values.iter().zip(exposed).map(|(value, exposed)| (value - ratio * exposed).abs());
                    (MIN_SHADOW_RATIO..1.0).contains(&ratio) && off.fold(0.0, f32::max) < MAX_SHADOW_TINT
                };
                let is_lit = || {
                    let ratios = values.iter().zip(exposed).map(|(value, exposed)| (value + 1.0) / (exposed + 1.0));
                    let (least, most) = ratios.fold((f32::MAX, 0.0f32), |ends, one| (ends.0.min(one), ends.1.max(one)));
                    least > MIN_LIT_RATIO && most < MAX_LIT_RATIO && most < MAX_LIT_TINT * least
                };
                self.labels.push(match most {
                    most if most < stays * weak => Label::Background,
                    _ if in_shadow() || is_lit() => Label::Relit,
                    most if most < stays * strong => Label::Weak,
                    _ => Label::Strong,
                });
            }
        }
    }

    /// Grows the background into relit pixels where the light changes smoothly, without an outline.
    fn grow_relit_background(&mut self, (width, height): (usize, usize)) {
        self.front.clear();
        let is_background = |&at: &u32| self.labels[at as usize] == Label::Background;
        self.front.extend((0..self.labels.len() as u32).filter(is_background));
        while let Some(at) = self.front.pop() {
            let (x, y) = (at as usize % width, at as usize / width);
            let ratio = self.ratios[at as usize];
            let sides = [
                (x > 0).then(|| at as usize - 1),
                (x + 1 < width).then(|| at as usize + 1),
                (y > 0).then(|| at as usize - width),
                (y + 1 < height).then(|| at as usize + width),
            ];
            for beside in sides.into_iter().flatten() {
                if self.labels[beside] == Label::Relit && (self.ratios[beside] - ratio).abs() < MAX_LIGHT_GRADIENT {
                    self.labels[beside] = Label::Background;
                    self.front.push(beside as u32);
                }
            }
        }
        for label in &mut self.labels {
            if *label == Label::Relit {
                *label = Label::Strong;
            }
        }
    }

    /// Finds the connected components with enough certain foreground pixels (hysteresis thresholding).
    fn find_components(&mut self, size: (usize, usize)) {
        let least = ((MIN_COMPONENT * self.labels.len() as f32) as usize).max(4);
        self.foreground.fill(false);
        self.pixels.clear();
        self.components.clear();
        self.seen.clear();
        self.seen.extend(self.labels.iter().map(|&label| label == Label::Background));
        for start in 0..self.labels.len() {
            if self.labels[start] != Label::Strong || self.seen[start] {
                continue;
            }
            let first = self.pixels.len();
            flood_fill(start, size, &mut self.seen, &mut self.pixels);
            let strong = self.pixels[first..].iter().filter(|&&at| self.labels[at as usize] == Label::Strong).count();
            if strong < least {
                self.pixels.truncate(first);
                continue;
            }
            self.pixels[first..].iter().for_each(|&at| self.foreground[at as usize] = true);
            self.components.push(Component { first, end: self.pixels.len() });
        }
    }

    /// Removes foreground that belongs to no person, such as the light of a lamp: pixels neither close to `persons` nor
    /// in a component that is connected to them and small enough to be held.
    pub fn keep_persons(&mut self, persons: &Mask, size: (usize, usize)) {
        let of_mask = (persons.width as usize, persons.height as usize);
        if persons.alpha.is_empty() {
            return;
        }
        self.seen.clear();
        self.seen.extend(persons.alpha.iter().map(|alpha| *alpha > MIN_PERSON_ALPHA));
        let mut near = std::mem::take(&mut self.near);
        near.clone_from(&self.seen);
        dilate(&mut near, &mut self.flags, of_mask.0, (CLOSE_FRACTION * of_mask.0 as f32).ceil() as usize);
        let place = |at: u32| nearest_index(at as usize, size, of_mask);
        let mut kept = 0;
        for component in &mut self.components {
            let range = component.first..component.end;
            let of_persons = self.pixels[range.clone()].iter().filter(|&&at| self.seen[place(at)]).count();
            let away = self.pixels[range.clone()].iter().filter(|&&at| !near[place(at)]).count();
            let is_theirs = away as f32 <= MAX_HELD * of_persons as f32;
            let first = kept;
            for k in range {
                let at = self.pixels[k];
                if is_theirs || near[place(at)] {
                    self.pixels[kept] = at;
                    kept += 1;
                } else {
                    self.foreground[at as usize] = false;
                }
            }
            *component = Component { first, end: kept };
        }
        self.pixels.truncate(kept);
        self.components.retain(|component| component.first < component.end);
        self.near = near;
    }

    /// Fills small holes: colours that happen to match the background.
    fn fill_holes(&mut self, size: (usize, usize)) {
        let most = (MAX_HOLE * self.labels.len() as f32) as usize;
        self.seen.clone_from(&self.foreground);
        for start in 0..self.seen.len() {
            if self.seen[start] {
                continue;
            }
            self.front.clear();
            flood_fill(start, size, &mut self.seen, &mut self.front);
            if self.front.len() <= most {
                self.front.iter().for_each(|&at| self.foreground[at as usize] = true);
            }
        }
    }
}

/// Appends to `pixels` the unseen pixels connected to `start`, 8-connected.
fn flood_fill(start: usize, (width, height): (usize, usize), seen: &mut [bool], pixels: &mut Vec<u32>) {
    let mut next = pixels.len();
    seen[start] = true;
    pixels.push(start as u32);
    while let Some(&at) = pixels.get(next) {
        next += 1;
        let (x, y) = (at as usize % width, at as usize / width);
        for y in y.saturating_sub(1)..(y + 2).min(height) {
            for x in x.saturating_sub(1)..(x + 2).min(width) {
                if !std::mem::replace(&mut seen[y * width + x], true) {
                    pixels.push((y * width + x) as u32);
                }
            }
        }
    }
}

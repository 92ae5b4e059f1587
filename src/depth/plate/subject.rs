//! What stands before the plate: pixels that differ from it, less what is only lit otherwise, joined to parts.

use crate::depth::alignment::Alignment;
use crate::depth::dilation::dilate;
use crate::depth::reduced::MOST;
use crate::depth::tap::nearest;
use crate::frame::Mask;

/// Differences from here on may be of something before the plate, and from the second on are, in a quiet picture.
const WEAK: f32 = 6.0;
const STRONG: f32 = 13.0;
/// The same in a noisy one, in standard deviations.
const WEAK_DEVIATIONS: f32 = 4.0;
const STRONG_DEVIATIONS: f32 = 8.0;
/// No camera is noisier than this, in what is left of it in a reduced pixel.
const MOST_DEVIATION: f32 = 3.0;
/// What was before the plate a frame ago is so from this share of the threshold on (hysteresis).
const STAYS: f32 = 0.75;
/// A shadow leaves this share of the light's root, at least, and the same colour but for a difference of so much.
const DARKEST_SHADOW: f32 = 0.72;
const SHADE: f32 = 4.0;
/// A lamp that is switched on makes the root of no channel less, or so many times what it was; and of one no more than so many
/// times what it makes of another.
const UNLIT: f32 = 0.98;
const BRIGHTEST: f32 = 1.8;
const TINT: f32 = 1.25;
/// From one pixel to the next, light changes by no more than this: outlines do.
const SOFT: f32 = 0.035;
/// Parts of less than this share of the picture are noise.
const LEAST_PART: f32 = 0.002;
/// Holes of less than this share of the picture are no background.
const LEAST_HOLE: f32 = 0.001;

/// A mask of persons says so from here on. What is as close to them as this, as a share of the picture's width, is theirs;
/// and so is what else is joined to them, as what they hold, unless it is larger than this share of them.
const PERSON: f32 = 0.5;
const CLOSE: f32 = 0.02;
const HELD: f32 = 0.3;

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Label {
    Background,
    /// As the background, but in shadow or in another light.
    Relit,
    /// Perhaps something before it.
    Weak,
    Strong,
}

/// A part of the picture that hangs together.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Where its pixels begin in [`Subject::pixels`], and where they end.
    pub first: usize,
    pub end: usize,
}

/// How far values of a row, three a pixel, are from those of the plate: half a pixel of what is `beside` it (above and below;
/// left and right are in `own`) is no difference, as nothing stands that still. Values of the plate times `gain`.
fn differences(now: &[f32], own: &[f32], beside: [&[f32]; 2], gain: &[f32], off: &mut [f32]) {
    let count = off.len();
    let off_at = |value: f32, own: f32, around: [f32; 4], gain: f32| {
        let halves = around.map(|beside| 0.5 * (own + beside));
        let low = halves.into_iter().fold(own, f32::min);
        let high = halves.into_iter().fold(own, f32::max);
        // What is cut off at white is at least as bright.
        ((gain * low).min(MOST) - value).max(value - (gain * high).min(MOST))
    };
    let [above, below] = beside.map(|row| &row[..count]);
    let (now, own, gain) = (&now[..count], &own[..count], &gain[..count]);
    for k in 3..count.max(6) - 3 {
        off[k] = off_at(now[k], own[k], [own[k - 3], own[k + 3], above[k], below[k]], gain[k]);
    }
    // At both ends there is nothing on one side.
    for k in (0..count.min(3)).chain(count.saturating_sub(3).max(3)..count) {
        let (left, right) = (own[if k < 3 { k } else { k - 3 }], own[if k + 3 < count { k + 3 } else { k }]);
        off[k] = off_at(now[k], own[k], [left, right, above[k], below[k]], gain[k]);
    }
}

/// Finds what stands before a plate; owns the memory for it.
#[derive(Debug, Default)]
pub struct Subject {
    labels: Vec<Label>,
    /// Of a row, three values a pixel: the gain, and how far each is from the plate's.
    line: Vec<f32>,
    off: Vec<f32>,
    /// How bright a pixel is beside its plate.
    ratios: Vec<f32>,
    seen: Vec<bool>,
    front: Vec<u32>,
    sample: Vec<f32>,
    /// A line of flags.
    flags: Vec<bool>,
    /// Whether a pixel of a mask of persons is one, or close to one.
    near: Vec<bool>,
    /// Whether a pixel is of something before the plate.
    pub foreign: Vec<bool>,
    /// The pixels of all parts, part by part.
    pub pixels: Vec<u32>,
    pub parts: Vec<Part>,
}

impl Subject {
    /// How much of the picture is before the plate, 0 to 1.
    pub fn share(&self) -> f32 {
        self.pixels.len() as f32 / self.foreign.len().max(1) as f32
    }

    /// Compares a picture with its plate; `foreign` is what it was in the frame before, and is what it is now, after.
    pub fn find(&mut self, now: &[[f32; 3]], plate: &[[f32; 3]], size: (usize, usize), alignment: &Alignment) {
        let deviation = self.deviation(now, plate, alignment);
        let weak = WEAK.max(WEAK_DEVIATIONS * deviation);
        let strong = STRONG.max(STRONG_DEVIATIONS * deviation);
        self.label(now, plate, size, (alignment.gain, weak, strong));
        self.grow_light(size);
        self.join(size);
        self.fill_holes(size);
    }

    /// The standard deviation of noise, from the median of what differs where nothing stood before the plate.
    fn deviation(&mut self, now: &[[f32; 3]], plate: &[[f32; 3]], alignment: &Alignment) -> f32 {
        /// The median of absolute values of a normal distribution is so much of its deviation.
        const MEDIAN: f32 = 0.6745;
        self.sample.clear();
        let all = now.iter().zip(plate).zip(&self.foreign).filter(|(_, foreign)| !**foreign);
        // Some are enough.
        self.sample.extend(all.step_by(5).map(|((now, plate), _)| (now[1] - alignment.gain[1] * plate[1]).abs()));
        let middle = self.sample.len() / 2;
        match self.sample.is_empty() {
            true => 0.0,
            false => (*self.sample.select_nth_unstable_by(middle, f32::total_cmp).1 / MEDIAN).min(MOST_DEVIATION),
        }
    }

    fn label(
        &mut self,
        now: &[[f32; 3]],
        plate: &[[f32; 3]],
        (width, height): (usize, usize),
        (gain, weak, strong): ([f32; 3], f32, f32),
    ) {
        self.labels.clear();
        self.ratios.clear();
        self.foreign.resize(now.len(), false);
        let (now, plate) = (now.as_flattened(), plate.as_flattened());
        let line = 3 * width;
        self.line.clear();
        self.line.extend((0..width).flat_map(|_| gain));
        self.off.resize(line, 0.0);
        for y in 0..height {
            let row = |y: usize| &plate[y * line..][..line];
            let (own, values) = (row(y), &now[y * line..][..line]);
            let beside = [row(y.saturating_sub(1)), row((y + 1).min(height - 1))];
            differences(values, own, beside, &self.line, &mut self.off);
            for x in 0..width {
                let (at, of) = (y * width + x, 3 * x..3 * x + 3);
                let (values, off) = (&values[of.clone()], &self.off[of.clone()]);
                let exposed: [f32; 3] = std::array::from_fn(|p| gain[p] * own[3 * x + p]);
                let ratio = (values.iter().sum::<f32>() + 1.0) / (exposed.iter().sum::<f32>() + 1.0);
                self.ratios.push(ratio);
                let most = off[0].max(off[1]).max(off[2]).max(0.0);
                let stays = if self.foreign[at] { STAYS } else { 1.0 };
                let in_shadow = || {
                    let off = values.iter().zip(exposed).map(|(value, exposed)| (value - ratio * exposed).abs());
                    (DARKEST_SHADOW..1.0).contains(&ratio) && off.fold(0.0, f32::max) < SHADE
                };
                let is_lit = || {
                    let ratios = values.iter().zip(exposed).map(|(value, exposed)| (value + 1.0) / (exposed + 1.0));
                    let (least, most) = ratios.fold((f32::MAX, 0.0f32), |ends, one| (ends.0.min(one), ends.1.max(one)));
                    least > UNLIT && most < BRIGHTEST && most < TINT * least
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

    /// What the background goes over into without an outline is the background in another light.
    fn grow_light(&mut self, (width, height): (usize, usize)) {
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
                if self.labels[beside] == Label::Relit && (self.ratios[beside] - ratio).abs() < SOFT {
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

    /// Pixels that differ and hang together are a part, if enough of them differ much.
    fn join(&mut self, size: (usize, usize)) {
        let least = ((LEAST_PART * self.labels.len() as f32) as usize).max(4);
        self.foreign.fill(false);
        self.pixels.clear();
        self.parts.clear();
        self.seen.clear();
        self.seen.extend(self.labels.iter().map(|&label| label == Label::Background));
        for start in 0..self.labels.len() {
            if self.labels[start] != Label::Strong || self.seen[start] {
                continue;
            }
            let first = self.pixels.len();
            flood(start, size, &mut self.seen, &mut self.pixels);
            let strong = self.pixels[first..].iter().filter(|&&at| self.labels[at as usize] == Label::Strong).count();
            if strong < least {
                self.pixels.truncate(first);
                continue;
            }
            self.pixels[first..].iter().for_each(|&at| self.foreign[at as usize] = true);
            self.parts.push(Part { first, end: self.pixels.len() });
        }
    }

    /// What is nobody's, as where a lamp was switched on, is background: what is neither close to `persons` nor joined to them
    /// and small enough to be held.
    pub fn keep_persons(&mut self, persons: &Mask, size: (usize, usize)) {
        let of_mask = (persons.width as usize, persons.height as usize);
        if persons.share.is_empty() {
            return;
        }
        self.seen.clear();
        self.seen.extend(persons.share.iter().map(|share| *share > PERSON));
        let mut near = std::mem::take(&mut self.near);
        near.clone_from(&self.seen);
        dilate(&mut near, &mut self.flags, of_mask.0, (CLOSE * of_mask.0 as f32).ceil() as usize);
        let place = |at: u32| nearest(at as usize, size, of_mask);
        let mut kept = 0;
        for part in &mut self.parts {
            let range = part.first..part.end;
            let of_persons = self.pixels[range.clone()].iter().filter(|&&at| self.seen[place(at)]).count();
            let away = self.pixels[range.clone()].iter().filter(|&&at| !near[place(at)]).count();
            let is_theirs = away as f32 <= HELD * of_persons as f32;
            let first = kept;
            for k in range {
                let at = self.pixels[k];
                if is_theirs || near[place(at)] {
                    self.pixels[kept] = at;
                    kept += 1;
                } else {
                    self.foreign[at as usize] = false;
                }
            }
            *part = Part { first, end: kept };
        }
        self.pixels.truncate(kept);
        self.parts.retain(|part| part.first < part.end);
        self.near = near;
    }

    /// Small holes are a part's own: colours that happen to be those of the background behind.
    fn fill_holes(&mut self, size: (usize, usize)) {
        let most = (LEAST_HOLE * self.labels.len() as f32) as usize;
        self.seen.clone_from(&self.foreign);
        for start in 0..self.seen.len() {
            if self.seen[start] {
                continue;
            }
            self.front.clear();
            flood(start, size, &mut self.seen, &mut self.front);
            if self.front.len() <= most {
                self.front.iter().for_each(|&at| self.foreign[at as usize] = true);
            }
        }
    }
}

/// Adds to `pixels` all that hang together with `start` and were not seen, corners included.
fn flood(start: usize, (width, height): (usize, usize), seen: &mut [bool], pixels: &mut Vec<u32>) {
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

//! Normalises a network's relative inverse depth.
//!
//! The network's values increase with nearness, but their scale and offset vary from frame to frame. Two anchors in the
//! picture fix both: the subject, and the farthest surface.

use super::background_worker::BackgroundWorker;
use super::picture_network::PictureNetwork;
use bokehcam::depth::tap::nearest_index;
use bokehcam::frame::{ColorImage, Mask};

/// Fraction of the sorted values that is ignored at each end.
const OUTLIERS: f32 = 0.03;
/// Uncertainty of the network's outlines, in its pixels: within it around a person, the background is unknown.
const MARGIN_PX: usize = 7;
/// Radius of the box filter that extends the surroundings behind a person, in pixels.
const BOX_RADIUS_PX: usize = 24;
/// Upper bound of the nearness behind a subject, so that it stays background.
const MAX_BACKGROUND_NEARNESS: f32 = 0.9;

/// Relative depth from frame to frame.
pub struct RelativeDepth {
    /// The latest result.
    map: NearnessMap,
    /// `None` while the worker thread has it.
    estimator: Option<Box<DepthEstimator>>,
    worker: Option<BackgroundWorker<Box<DepthEstimator>>>,
}

/// The result for one picture.
#[derive(Default)]
struct NearnessMap {
    /// Columns and rows.
    size: (usize, usize),
    /// Relative inverse depth: 1 at the subject, 0 at the farthest surface.
    nearness: Vec<f32>,
    /// Relative inverse depth with the subject removed.
    background: Vec<f32>,
}

/// Computes relative depth; moved to the worker thread and back.
struct DepthEstimator {
    picture_network: PictureNetwork,
    map: NearnessMap,
    result: Result<(), String>,
    /// The subject's mask in the current picture; empty without a subject.
    mask: Mask,
    /// Mask value of each pixel, at the network's resolution.
    subject: Vec<f32>,
    known: Vec<f32>,
    spread: Vec<f32>,
    sorted: Vec<f32>,
    line: Vec<f32>,
}

impl RelativeDepth {
    pub fn new(picture_network: PictureNetwork) -> Self {
        let estimator = DepthEstimator {
            picture_network,
            map: NearnessMap::default(),
            result: Ok(()),
            mask: Mask::default(),
            subject: Vec::new(),
            known: Vec::new(),
            spread: Vec::new(),
            sorted: Vec::new(),
            line: Vec::new(),
        };
        Self { map: NearnessMap::default(), estimator: Some(Box::new(estimator)), worker: None }
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        self.map.size
    }

    /// Returns the relative inverse depth of the latest picture: 1 at the subject, 0 at the farthest surface.
    pub fn nearness(&self) -> &[f32] {
        &self.map.nearness
    }

    /// Returns the relative inverse depth with the subject removed, below 1.
    pub fn background(&self) -> &[f32] {
        &self.map.background
    }

    /// Computes the relative depth of a picture. The subject is in `mask`; without a mask, it is the nearest surface.
    ///
    /// # Errors
    /// See [`PictureNetwork::infer`].
    pub fn run(&mut self, color: &ColorImage, mask: Option<&Mask>) -> Result<(), String> {
        self.collect(true)?;
        let Some(mut estimator) = self.estimator.take() else { return Ok(()) };
        estimator.set_picture(color, mask);
        estimator.estimate();
        self.store(estimator)
    }

    /// Computes it on the worker thread, once there is a first result: [`Self::collect`] collects it later. Does
    /// nothing while another picture is in progress.
    ///
    /// # Errors
    /// See [`PictureNetwork::infer`].
    pub fn submit(&mut self, color: &ColorImage, mask: Option<&Mask>) -> Result<(), String> {
        if self.map.nearness.is_empty() {
            return self.run(color, mask);
        }
        self.collect(false)?;
        let Some(mut estimator) = self.estimator.take() else { return Ok(()) };
        estimator.set_picture(color, mask);
        if self.worker.is_none() {
            self.worker =
                BackgroundWorker::new("inference", |estimator: &mut Box<DepthEstimator>| estimator.estimate());
        }
        let submitted = match &self.worker {
            Some(worker) => worker.submit(estimator),
            None => Err(estimator),
        };
        submitted.or_else(|mut estimator| {
            estimator.estimate();
            self.store(estimator)
        })
    }

    /// Collects the thread's result if it is done; waits for it if `wait`.
    ///
    /// # Errors
    /// See [`PictureNetwork::infer`].
    pub fn collect(&mut self, wait: bool) -> Result<(), String> {
        match self
            .worker
            .as_ref()
            .filter(|_| self.estimator.is_none())
            .map(|worker| worker.collect(wait))
            .transpose()?
        {
            Some(Some(estimator)) => self.store(estimator),
            _ => Ok(()),
        }
    }

    fn store(&mut self, mut estimator: Box<DepthEstimator>) -> Result<(), String> {
        let result = std::mem::replace(&mut estimator.result, Ok(()));
        if result.is_ok() {
            std::mem::swap(&mut self.map, &mut estimator.map);
        }
        self.estimator = Some(estimator);
        result
    }
}

impl DepthEstimator {
    fn set_picture(&mut self, color: &ColorImage, mask: Option<&Mask>) {
        self.picture_network.set_picture(color);
        match mask {
            Some(mask) => self.mask.clone_from(mask),
            None => self.mask.resize(0, 0),
        }
    }

    fn estimate(&mut self) {
        let Self { picture_network, map: NearnessMap { size, nearness, .. }, mask, subject, result, .. } = self;
        let output = match picture_network.run() {
            Ok(output) => output,
            Err(why) => {
                *result = Err(why);
                return;
            }
        };
        *size = output.size;
        let pixels = output.size.0 * output.size.1;
        nearness.clear();
        nearness.extend((0..pixels).map(|pixel| output.at(pixel, 0)));
        subject.clear();
        let of_mask = (mask.width as usize, mask.height as usize);
        let alpha = |at: usize| if of_mask.0 == 0 { 0.0 } else { mask.alpha[nearest_index(at, output.size, of_mask)] };
        subject.extend((0..pixels).map(alpha));
        self.normalize();
        self.extrapolate_background();
    }

    /// Maps the network's values linearly to nearness: the farthest surface (a low quantile outside of the person) to
    /// 0, the subject (the median of the person, else a high quantile) to 1.
    fn normalize(&mut self) {
        let Self { map: NearnessMap { nearness, .. }, subject: alphas, sorted, .. } = self;
        let mut anchor = |quantile: f32, counts: &dyn Fn(usize) -> bool| {
            sorted.clear();
            sorted.extend(nearness.iter().enumerate().filter(|(at, _)| counts(*at)).map(|(_, &value)| value));
            let at = (quantile * sorted.len().saturating_sub(1) as f32) as usize;
            (!sorted.is_empty()).then(|| *sorted.select_nth_unstable_by(at, f32::total_cmp).1)
        };
        let person = |at: usize| alphas[at] > 0.9;
        let farthest = anchor(OUTLIERS, &|at| !person(at)).or_else(|| anchor(OUTLIERS, &|_| true));
        let subject = anchor(0.5, &person).or_else(|| anchor(1.0 - OUTLIERS, &|_| true));
        let (Some(farthest), Some(subject)) = (farthest, subject) else { return };
        let scale = 1.0 / (subject - farthest).max(1e-6);
        nearness.iter_mut().for_each(|value| *value = (*value - farthest) * scale);
    }

    /// Extrapolates the surroundings behind the subject by normalised convolution.
    fn extrapolate_background(&mut self) {
        let Self { map: NearnessMap { size, nearness, background }, subject, known, spread, line, .. } = self;
        let size = *size;
        background.clone_from(nearness);
        if subject.iter().all(|&alpha| alpha < 0.5) {
            // Without a person, the nearest surface stays background, too.
            background.iter_mut().for_each(|nearness| *nearness = nearness.min(MAX_BACKGROUND_NEARNESS));
            return;
        }
        known.clear();
        known.extend(subject.iter().map(|&alpha| f32::from(u8::from(alpha < 0.5))));
        // Near an outline, the values mix both surfaces.
        erode(known, line, size);
        for (value, known) in background.iter_mut().zip(&*known) {
            *value *= known;
        }
        let total = |plane: &[f32]| plane.iter().sum::<f32>();
        let elsewhere = total(background) / total(known).max(1.0);
        spread.clone_from(known);
        for plane in [&mut *background, &mut *spread] {
            // Two box filters: smooth, and as wide as a person.
            for _ in 0..2 {
                box_filter(plane, line, size);
            }
        }
        for at in 0..nearness.len() {
            background[at] = match () {
                () if known[at] > 0.0 => nearness[at],
                () if spread[at] > 1e-3 => background[at] / spread[at],
                () => elsewhere,
            }
            .min(MAX_BACKGROUND_NEARNESS);
        }
    }
}

/// Calls `change` with every row of a plane, then with every column.
fn filter_separably(
    plane: &mut [f32],
    line: &mut Vec<f32>,
    (width, height): (usize, usize),
    change: impl Fn(&[f32], &mut dyn FnMut(usize, f32)),
) {
    for y in 0..height {
        line.clear();
        line.extend_from_slice(&plane[y * width..][..width]);
        change(line, &mut |x, value| plane[y * width + x] = value);
    }
    for x in 0..width {
        line.clear();
        line.extend((0..height).map(|y| plane[y * width + x]));
        change(line, &mut |y, value| plane[y * width + x] = value);
    }
}

/// Sets to 0 everything within [`MARGIN_PX`] of a 0.
fn erode(plane: &mut [f32], line: &mut Vec<f32>, size: (usize, usize)) {
    filter_separably(plane, line, size, |line, set| {
        let mut last = None;
        for (at, &value) in line.iter().enumerate() {
            if value == 0.0 {
                let from = last.map_or(0, |last| last + 1).max(at.saturating_sub(MARGIN_PX));
                (from..at).for_each(|before| set(before, 0.0));
                last = Some(at);
            } else if last.is_some_and(|last| at <= last + MARGIN_PX) {
                set(at, 0.0);
            }
        }
    });
}

/// Applies a box filter of radius [`BOX_RADIUS_PX`], rows then columns.
fn box_filter(plane: &mut [f32], line: &mut Vec<f32>, size: (usize, usize)) {
    filter_separably(plane, line, size, |line, set| {
        let (mut sum, radius) = (0.0f64, BOX_RADIUS_PX.min(line.len() - 1));
        line[..radius].iter().for_each(|&value| sum += f64::from(value));
        for at in 0..line.len() {
            sum += line.get(at + radius).map_or(0.0, |&value| f64::from(value));
            set(at, (sum / (2 * radius + 1) as f64) as f32);
            sum -= at.checked_sub(radius).map_or(0.0, |left| f64::from(line[left]));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_pixels_spread_and_means_are_means() {
        let size = (40, 3);
        let mut plane = vec![1.0; 120];
        plane[40 + 20] = 0.0;
        erode(&mut plane, &mut Vec::new(), size);
        let row: Vec<usize> = (0..40).filter(|&x| plane[40 + x] == 0.0).collect();
        assert_eq!((row[0], row[row.len() - 1], row.len()), (20 - MARGIN_PX, 20 + MARGIN_PX, 2 * MARGIN_PX + 1));
        assert_eq!(plane[20], 0.0, "rows above and below, too");
        let mut wide = vec![0.0; 101];
        wide[50] = 49.0;
        box_filter(&mut wide, &mut Vec::new(), (101, 1));
        for (x, value) in wide.iter().enumerate() {
            let expected = if x.abs_diff(50) <= BOX_RADIUS_PX { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-5, "{x}: {value}");
        }
    }
}

//! Foreground from a plate: a picture of the background, captured once by a camera at rest. It needs no network, and
//! includes the objects that a person holds.
//!
//! Each picture is compared with the plate in reduced resolution, after compensating for exposure, white balance and
//! shift; shadows count as background. The plate is updated where there is no foreground.

mod capture;
mod learning;
mod source;
mod subject;

pub use capture::{Capture, CaptureResult, Obstacle};
pub use source::{CameraLock, Companion, Guide, PlateDepth, Step};

use learning::{PlateUpdater, UpdateInput};
use subject::Subject;

use crate::depth::alignment::{Aligner, Alignment};
use crate::depth::matting::mask::BackgroundPlate;
use crate::depth::reduced::{Reducer, block_px, reduced_size};
use crate::frame::{ColorImage, Mask};

/// Iterations of the alignment on the first picture; later ones need one.
const FIRST_ITERATIONS: usize = 8;
/// The plate no longer matches the picture above the first fraction of foreground, and matches again below the second.
const MAX_FOREGROUND: f32 = 0.6;
const MATCHING_FOREGROUND: f32 = 0.5;

/// A plate in use.
#[derive(Debug)]
pub struct Plate {
    color: ColorImage,
    reduced: Vec<[f32; 3]>,
    reducer: Reducer,
    now: Vec<[f32; 3]>,
    aligner: Aligner,
    alignment: Alignment,
    subject: Subject,
    updater: PlateUpdater,
    /// Linear light of each code of the plate, by channel, at the current exposure.
    light: Box<[[f32; 256]; 3]>,
    mask: Mask,
    has_started: bool,
    is_matching: bool,
}

impl Plate {
    /// Creates a plate from its picture.
    pub fn new(color: ColorImage) -> Self {
        let (mut reducer, mut reduced) = (Reducer::default(), Vec::new());
        reducer.reduce(&color, &mut reduced);
        Self {
            color,
            reduced,
            reducer,
            now: Vec::new(),
            aligner: Aligner::default(),
            alignment: Alignment::default(),
            subject: Subject::default(),
            updater: PlateUpdater::default(),
            light: Box::new([[0.0; 256]; 3]),
            mask: Mask::default(),
            has_started: false,
            is_matching: true,
        }
    }

    /// Returns the plate's picture, with all updates.
    pub fn color(&self) -> &ColorImage {
        &self.color
    }

    /// Returns the plate as a background at the current exposure and shift.
    pub fn as_background_plate(&self) -> BackgroundPlate<'_> {
        let block_px = block_px(self.color.width) as f32;
        let shift_px = self.alignment.shift.map(|shift| (shift * block_px).round() as isize);
        BackgroundPlate { color: &self.color, light: &self.light, shift_px }
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        self.color.size()
    }

    /// Returns the mask of the foreground in the last picture.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Compares a picture of the plate's size with it; a mask of `persons`, if known, restricts the foreground. Returns
    /// whether the plate matches the place and the light.
    pub fn update(&mut self, color: &ColorImage, time_ns: u64, persons: Option<&Mask>) -> bool {
        let size = reduced_size(color);
        self.reducer.reduce(color, &mut self.now);
        self.subject.foreground.resize(self.now.len(), false);
        if !self.is_matching {
            // The alignment with a mismatched picture is no starting point.
            self.alignment = Alignment::default();
            self.subject.foreground.fill(false);
            self.has_started = false;
        }
        let Self { reduced, now, aligner, alignment, subject, .. } = self;
        for _ in 0..if self.has_started { 1 } else { FIRST_ITERATIONS } {
            aligner.shift_plate(reduced, size, alignment.shift);
            aligner.update(now, &subject.foreground, (size.0, (0..size.1).step_by(1)), alignment);
            aligner.shift_plate(reduced, size, alignment.shift);
            subject.segment(now, aligner.shifted_plate(), size, alignment);
        }
        if let Some(persons) = persons {
            subject.keep_persons(persons, size);
        }
        self.has_started = true;
        self.is_matching =
            subject.foreground_fraction() < if self.is_matching { MAX_FOREGROUND } else { MATCHING_FOREGROUND };
        if self.is_matching {
            let input = UpdateInput { color, now, subject, alignment, time_ns };
            if self.updater.update_plate(input, &self.reducer, &mut self.color, reduced) {
                aligner.invalidate();
            }
        }
        self.draw_mask(size);
        self.reducer.fill_exposure_tables(self.alignment.gain, &mut self.light);
        self.is_matching
    }

    /// Draws the mask, soft at outlines: the mean over 3x3 pixels.
    fn draw_mask(&mut self, (width, height): (usize, usize)) {
        self.mask.resize(width as u32, height as u32);
        let foreground = &self.subject.foreground;
        for y in 0..height {
            for x in 0..width {
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                let rows = y.saturating_sub(1)..(y + 2).min(height);
                let pixels = rows.len() * columns.len();
                let count = |y: usize| {
                    foreground[y * width..][columns.clone()].iter().filter(|foreground| **foreground).count()
                };
                self.mask.alpha[y * width + x] = rows.map(count).sum::<usize>() as f32 / pixels as f32;
            }
        }
    }
}

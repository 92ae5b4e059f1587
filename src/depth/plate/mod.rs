//! Foreground from a plate: a picture of the background, captured once by a camera at rest. It needs no network, and
//! includes the objects that a person holds.
//!
//! Each picture is compared with the plate in reduced resolution, after compensating for exposure, white balance and
//! shift; shadows count as background. The plate is updated where there is no foreground.

mod capture;
mod learning;
mod source;
mod subject;

pub use capture::{Capture, Taken};
pub use source::{Companion, Guide, Lock, PlateDepth, Step};

use learning::{Learning, Lesson};
use subject::Subject;

use crate::depth::alignment::{Aligner, Alignment};
use crate::depth::matting::mask::BackgroundPlate;
use crate::depth::reduced::{Reducer, block_px, reduced_size};
use crate::frame::{ColorImage, Mask};

/// Iterations of the alignment on the first picture; later ones need one.
const FIRST_STEPS: usize = 8;
/// The plate no longer matches the picture above the first fraction of foreground, and matches again below the second.
const MAX_FOREGROUND: f32 = 0.6;
const FIT_FOREGROUND: f32 = 0.5;

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
    learning: Learning,
    /// Linear light of each code of the plate, by channel, at the current exposure.
    light: Box<[[f32; 256]; 3]>,
    mask: Mask,
    begun: bool,
    fits: bool,
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
            learning: Learning::default(),
            light: Box::new([[0.0; 256]; 3]),
            mask: Mask::default(),
            begun: false,
            fits: true,
        }
    }

    /// Returns the plate's picture, with all updates.
    pub fn color(&self) -> &ColorImage {
        &self.color
    }

    /// Returns the plate as a background at the current exposure and shift.
    pub fn backdrop(&self) -> BackgroundPlate<'_> {
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
    pub fn look(&mut self, color: &ColorImage, time_ns: u64, persons: Option<&Mask>) -> bool {
        let size = reduced_size(color);
        self.reducer.reduce(color, &mut self.now);
        self.subject.foreign.resize(self.now.len(), false);
        if !self.fits {
            // The alignment with a mismatched picture is no starting point.
            self.alignment = Alignment::default();
            self.subject.foreign.fill(false);
            self.begun = false;
        }
        let Self { reduced, now, aligner, alignment, subject, .. } = self;
        for _ in 0..if self.begun { 1 } else { FIRST_STEPS } {
            aligner.shift(reduced, size, alignment.shift);
            aligner.step(now, &subject.foreign, size, alignment);
            aligner.shift(reduced, size, alignment.shift);
            subject.find(now, aligner.shifted(), size, alignment);
        }
        if let Some(persons) = persons {
            subject.keep_persons(persons, size);
        }
        self.begun = true;
        self.fits = subject.foreground_fraction() < if self.fits { MAX_FOREGROUND } else { FIT_FOREGROUND };
        if self.fits {
            let lesson = Lesson { color, now, subject, alignment, time_ns };
            if self.learning.learn(lesson, &self.reducer, &mut self.color, reduced) {
                aligner.forget();
            }
        }
        self.draw_mask(size);
        self.reducer.expose(self.alignment.gain, &mut self.light);
        self.fits
    }

    /// Draws the mask, soft at outlines: the mean over 3x3 pixels.
    fn draw_mask(&mut self, (width, height): (usize, usize)) {
        self.mask.resize(width as u32, height as u32);
        let foreign = &self.subject.foreign;
        for y in 0..height {
            for x in 0..width {
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                let rows = y.saturating_sub(1)..(y + 2).min(height);
                let pixels = rows.len() * columns.len();
                let count = |y: usize| foreign[y * width..][columns.clone()].iter().filter(|foreign| **foreign).count();
                self.mask.alpha[y * width + x] = rows.map(count).sum::<usize>() as f32 / pixels as f32;
            }
        }
    }
}

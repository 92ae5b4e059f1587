//! Who stands before a plate: a picture of what is behind, taken once from a camera that stands still. No network is
//! needed, and what a person holds is theirs.
//!
//! Each picture is compared with the plate in few pixels, after its exposure, white balance and shift are
//! taken out of it; shadows are background. The plate goes on learning where nobody is.

mod capture;
mod learning;
mod source;
mod subject;

pub use capture::{Capture, Taken};
pub use source::{Companion, Guide, Lock, PlateDepth, Step};

use learning::{Learning, Lesson};
use subject::Subject;

use crate::depth::alignment::{Aligner, Alignment};
use crate::depth::matting::mask::Backdrop;
use crate::depth::reduced::{Reducer, block_px, reduced_size};
use crate::frame::{ColorImage, Mask};

/// Steps of the alignment with the first picture; later ones need one.
const FIRST_STEPS: usize = 8;
/// A plate from which more of the picture differs is none of it, and fits again when less does.
const MOST_SHARE: f32 = 0.6;
const LESS_SHARE: f32 = 0.5;

/// A plate at work.
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
    /// The light of each code of the plate, by channel, as the camera exposes now.
    light: Box<[[f32; 256]; 3]>,
    mask: Mask,
    begun: bool,
    fits: bool,
}

impl Plate {
    /// A plate that was taken.
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

    /// What it shows now.
    pub fn color(&self) -> &ColorImage {
        &self.color
    }

    /// What it shows, as the camera sees it now.
    pub fn backdrop(&self) -> Backdrop<'_> {
        let block_px = block_px(self.color.width) as f32;
        let shift_px = self.alignment.shift.map(|shift| (shift * block_px).round() as isize);
        Backdrop { color: &self.color, light: &self.light, shift_px }
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        self.color.size()
    }

    /// Who stands before it, in the picture that was looked at last.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Compares a picture of the same size with the plate, where `persons` are known or not. Whether it is of the same
    /// place and light.
    pub fn look(&mut self, color: &ColorImage, time_ns: u64, persons: Option<&Mask>) -> bool {
        let size = reduced_size(color);
        self.reducer.reduce(color, &mut self.now);
        self.subject.foreign.resize(self.now.len(), false);
        if !self.fits {
            // What was found of another picture is no way back to this one.
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
        self.fits = subject.share() < if self.fits { MOST_SHARE } else { LESS_SHARE };
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

    /// The mask is undecided at outlines: the mean of a pixel and those around it.
    fn draw_mask(&mut self, (width, height): (usize, usize)) {
        self.mask.resize(width as u32, height as u32);
        let foreign = &self.subject.foreign;
        for y in 0..height {
            for x in 0..width {
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                let rows = y.saturating_sub(1)..(y + 2).min(height);
                let pixels = rows.len() * columns.len();
                let count = |y: usize| foreign[y * width..][columns.clone()].iter().filter(|foreign| **foreign).count();
                self.mask.share[y * width + x] = rows.map(count).sum::<usize>() as f32 / pixels as f32;
            }
        }
    }
}

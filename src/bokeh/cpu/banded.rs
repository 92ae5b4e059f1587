//! Blurs a picture as a whole, or a large one in bands of rows, one after the other: the memory for bins is then that of
//! a band.
//!
//! Each band is blurred with the rows around it that can change its result ([`Plan::support_rows`]), and with the bins of
//! the whole picture. The result is the same to the bit, unless hidden background is inpainted: from the whole picture
//! then, and from a band with many rows around it here.

use std::borrow::Cow;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use super::encode::Encoder;
use super::unpack::nearest_sample;
use super::{CpuBokeh, Radii, Sample};
use crate::bokeh::BlurredFrame;
use crate::bokeh::plan::Plan;
use crate::budget::Quality;
use crate::compute::thread_pool::core_count;
use crate::frame::{DepthMap, Matte, MixedPixel, resize_buffer};
use crate::optics::CocField;

/// Pictures of more pixels are blurred in bands.
pub const MAX_WHOLE_PIXELS: usize = 32 << 20;
/// Pixels of a band, without the rows around it.
const BAND_PIXELS: usize = 8 << 20;
/// Bands begin at a multiple of this many rows: whole cells at the coarsest scale, and whole pixels of the coarser levels
/// of the inpainting's pyramid.
const ROW_MULTIPLE: usize = 256;

/// Runs a plan on the CPU, for pictures of any size: as a whole, or band by band.
pub struct BandedBokeh {
    /// The plan of whole pictures.
    pub(super) plan: Plan,
    threads: usize,
    /// Rows of a band, without those around it: a multiple of [`ROW_MULTIPLE`]. `None` blurs the whole at once.
    rows: Option<usize>,
    /// Blurs whole pictures; bands have one of their own.
    whole: Option<CpuBokeh>,
    /// Encodes results, if not as 8-bit sRGB.
    pub(super) encoder: Option<Arc<Encoder>>,
    /// The last frame, until it is collected.
    pub(super) done: Option<BlurredFrame>,
}

/// The circle of confusion of a band, as [`Radii`].
enum BandRadii<'a> {
    Uniform(CocField),
    Each(Cow<'a, [f32]>),
    Depth(CocField, Box<DepthMap>),
}

impl BandedBokeh {
    /// Creates an executor of `plan` on `threads` threads (all cores when `None`): in bands of rows for large pictures.
    pub fn new(plan: Plan, threads: Option<usize>) -> Self {
        let threads = threads.unwrap_or_else(core_count);
        if plan.width * plan.height > MAX_WHOLE_PIXELS {
            let rows = BAND_PIXELS / plan.width.max(1);
            return Self::with_rows(plan, Some(threads), rows);
        }
        let whole = Some(CpuBokeh::new(plan.clone(), Some(threads)));
        Self { plan, threads, rows: None, whole, encoder: None, done: None }
    }

    /// Creates an executor with bands of about `rows` rows.
    #[doc(hidden)]
    pub fn with_rows(plan: Plan, threads: Option<usize>, rows: usize) -> Self {
        let threads = threads.unwrap_or_else(core_count);
        let rows = Some(rows.next_multiple_of(ROW_MULTIPLE).max(ROW_MULTIPLE));
        Self { plan, threads, rows, whole: None, encoder: None, done: None }
    }

    /// Returns the number of threads: fewer than requested if the system refused some.
    pub(super) fn thread_count(&self) -> usize {
        self.whole.as_ref().map_or(self.threads, |whole| whole.workers.thread_count())
    }

    /// Changes the quality of the next frames, if the plan has other levels.
    pub(super) fn set_quality(&mut self, quality: Quality) {
        self.plan.set_quality(quality);
        self.whole.iter_mut().for_each(|whole| whole.set_quality(quality));
    }

    /// Blurs the `pixels` of one picture into `out`, which has the same length. Calls `lap` with the name of each pass
    /// after it; `lap` may stop the frame, which leaves `out` unspecified.
    #[doc(hidden)]
    pub fn blur_pixels<T: Sample>(
        &mut self,
        pixels: &[T],
        coc: Radii<'_>,
        out: &mut [T],
        lap: impl FnMut(&'static str) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if let Some(rows) = self.rows {
            return self.blur_bands(rows, (pixels, out), coc, lap);
        }
        let whole = self.whole.get_or_insert_with(|| CpuBokeh::new(self.plan.clone(), Some(self.threads)));
        if let Some(encoder) = &self.encoder {
            whole.encoder = Arc::clone(encoder);
        }
        let flow = whole.blur_pixels(pixels, coc, out, lap);
        if flow.is_break() {
            // Its buffers hold parts of two frames now.
            self.whole = None;
        }
        flow
    }

    /// Blurs the pixels of one picture into others, in bands of `rows` rows.
    fn blur_bands<T: Sample>(
        &mut self,
        rows: usize,
        (from, into): (&[T], &mut [T]),
        coc: Radii<'_>,
        mut lap: impl FnMut(&'static str) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (width, height) = (self.plan.width, self.plan.height);
        coc.split(&mut self.plan);
        let mut executor: Option<CpuBokeh> = None;
        let mut result = Vec::new();
        for (rows, around) in split_into_bands(height, rows, self.plan.support_rows()) {
            let wanted = rows.start - around.start..rows.end - around.start;
            let plan = self.plan.for_band(around.clone(), wanted.clone());
            // Bands are as high as others but for the last one, and share an executor.
            let executor = match &mut executor {
                Some(executor) if executor.plan.height == plan.height => {
                    executor.plan = plan;
                    executor
                }
                executor => {
                    // Drops the old one before the new one allocates.
                    *executor = None;
                    executor.insert(CpuBokeh::new(plan, Some(self.threads)))
                }
            };
            let radii = self.plan.band_radii(coc, around.clone());
            // New memory takes pages only for the rows that are written.
            resize_buffer(&mut result, around.len() * width * 3);
            if let Some(encoder) = &self.encoder {
                executor.encoder = Arc::clone(encoder);
            }
            let pixels = &from[around.start * width * 3..around.end * width * 3];
            executor.blur_pixels(pixels, radii.as_radii(), &mut result, &mut lap)?;
            into[rows.start * width * 3..rows.end * width * 3]
                .copy_from_slice(&result[wanted.start * width * 3..wanted.end * width * 3]);
        }
        ControlFlow::Continue(())
    }
}

/// Returns the rows of each band, and those to blur for it, with at least `support` rows on both sides: all of them the
/// same number but for the last.
fn split_into_bands(height: usize, rows: usize, support: usize) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
    let support = support.next_multiple_of(ROW_MULTIPLE);
    let window = rows + 2 * support;
    let mut next: usize = 0;
    std::iter::from_fn(move || {
        let start = next;
        let first = start.saturating_sub(support);
        let last = (first + window).min(height);
        next = if last == height { height } else { last - support };
        (start < height).then_some((start..next, first..last))
    })
}

impl BandRadii<'_> {
    fn as_radii(&self) -> Radii<'_> {
        match self {
            Self::Uniform(field) => Radii::Field(field, None),
            Self::Each(coc_px) => Radii::Each(coc_px),
            Self::Depth(field, map) => Radii::Field(field, Some(map)),
        }
    }
}

impl Plan {
    /// Returns the CoC of some rows of the picture.
    fn band_radii<'a>(&self, coc: Radii<'a>, rows: Range<usize>) -> BandRadii<'a> {
        let (width, height) = (self.width, self.height);
        match coc {
            Radii::Each(coc_px) => BandRadii::Each(Cow::Borrowed(&coc_px[rows.start * width..rows.end * width])),
            Radii::Field(CocField::Ramp(ramp), _) => {
                let row = |y| (0..width).map(move |x| ramp.coc_px(x as f32, y as f32));
                BandRadii::Each(rows.flat_map(row).collect())
            }
            Radii::Field(coc @ CocField::Depth(_), Some(map)) if !map.metres.is_empty() => {
                let columns = map.width as usize;
                let mut band = DepthMap::default();
                band.resize(map.width, rows.len() as u32);
                for (out, y) in band.metres.chunks_exact_mut(columns).zip(rows.clone()) {
                    let from = nearest_sample(y, height, map.height as usize);
                    out.copy_from_slice(&map.metres[from * columns..][..columns]);
                }
                (band.subject_m, band.is_smooth) = (map.subject_m, map.is_smooth);
                if let Some(matte) = self.matte(Some(map), coc) {
                    let first = (rows.start * width) as u32;
                    let pixels = matte.pixels_in(rows.start * width..rows.end * width);
                    let moved = pixels.iter().map(|pixel| MixedPixel { at: pixel.at - first, ..*pixel });
                    band.matte = Matte { pixels: moved.collect() };
                }
                BandRadii::Depth(*coc, Box::new(band))
            }
            Radii::Field(coc, _) => BandRadii::Uniform(*coc),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::Settings;
    use crate::look::{Effect, Look};

    #[test]
    fn only_large_pictures_are_blurred_in_bands() {
        let settings = Look::with_effect(Effect::Blur).blur_settings((64, 64), false).expect("it blurs");
        let is_whole = |settings: &Settings, height| {
            let executor = BandedBokeh::new(Plan::new(settings, 64, height), Some(1));
            (executor.rows.is_none(), executor.whole.is_some())
        };
        let limit = (MAX_WHOLE_PIXELS / 64) as u32;
        assert_eq!(is_whole(&settings, 64), (true, true));
        assert_eq!(is_whole(&settings, limit + 1), (false, false));
    }

    #[test]
    fn bands_are_all_rows_once_and_have_the_rows_around_them() {
        for (height, rows, support) in [(1, 256, 9), (700, 256, 64), (769, 256, 1), (8192, 1024, 700), (16384, 512, 0)]
        {
            let (mut next, mut windows) = (0, Vec::new());
            for (band, around) in split_into_bands(height, rows, support) {
                assert_eq!(band.start, next);
                assert!(around.start.is_multiple_of(ROW_MULTIPLE) && around.end <= height);
                assert!(around.start == 0 || around.start + support <= band.start);
                assert!(around.end == height || band.end + support <= around.end);
                (next, windows) = (band.end, [windows, vec![around.len()]].concat());
            }
            assert_eq!(next, height);
            assert!(windows.windows(2).all(|pair| pair[0] >= pair[1]), "{windows:?}");
            assert!(windows.iter().rev().skip(1).all(|&window| window == windows[0]), "{windows:?}");
        }
    }
}

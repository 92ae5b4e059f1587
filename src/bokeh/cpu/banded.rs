//! Blurs a large picture in bands of rows, one after the other: the memory for bins is then that of a band.
//!
//! Each band is blurred with the rows around it that can change its result ([`Plan::support_rows`]), and with the bins of
//! the whole picture. The result is the same to the bit, unless hidden background is inpainted: from the whole picture
//! then, and from a band with many rows around it here.

use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::time::Instant;

use pulp::Arch;

use super::encode::Encoder;
use super::frames::{check_frame, create_encoder, describe};
use super::unpack::nearest_sample;
use super::{CpuBokeh, Radii, Sample};
use crate::bokeh::plan::Plan;
use crate::bokeh::{BlurredFrame, Bokeh, BokehError, Job, PassTimes, Picture};
use crate::color::Picture16;
use crate::compute::Backend;
use crate::compute::thread_pool::core_count;
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel, resize_buffer};
use crate::optics::CocField;

/// Pictures of more pixels are blurred in bands.
pub const MAX_WHOLE_PIXELS: usize = 32 << 20;
/// Pixels of a band, without the rows around it.
const BAND_PIXELS: usize = 8 << 20;
/// Bands begin at a multiple of this many rows: whole cells at the coarsest scale, and whole pixels of the coarser levels
/// of the inpainting's pyramid.
const ROW_MULTIPLE: usize = 256;

/// Runs a plan on the CPU, band by band.
pub struct BandedBokeh {
    /// The plan of whole pictures.
    plan: Plan,
    threads: usize,
    /// Rows of a band, without those around it: a multiple of [`ROW_MULTIPLE`].
    rows: usize,
    /// The last frame, until it is collected.
    done: Option<BlurredFrame>,
}

/// The circle of confusion of a band, as [`Radii`].
enum BandRadii {
    Uniform(CocField),
    Each(Vec<f32>),
    Depth(CocField, Box<DepthMap>),
}

impl BandedBokeh {
    /// Creates an executor of `plan` on `threads` threads (all cores when `None`).
    pub fn new(plan: Plan, threads: Option<usize>) -> Self {
        let rows = BAND_PIXELS / plan.width.max(1);
        Self::with_rows(plan, threads, rows)
    }

    /// Creates an executor with bands of about `rows` rows.
    #[doc(hidden)]
    pub fn with_rows(plan: Plan, threads: Option<usize>, rows: usize) -> Self {
        let threads = threads.unwrap_or_else(core_count);
        let rows = rows.next_multiple_of(ROW_MULTIPLE).max(ROW_MULTIPLE);
        Self { plan, threads, rows, done: None }
    }

    /// Blurs one picture.
    ///
    /// # Errors
    /// The picture and the plan have different sizes, or `coc` needs depth and the frame has none.
    pub fn blur(
        &mut self,
        color: &ColorImage,
        depth: Option<&DepthMap>,
        coc: &CocField,
        out: &mut ColorImage,
    ) -> Result<PassTimes, BokehError> {
        check_frame(&self.plan, color.size(), depth, coc)?;
        out.resize(color.width, color.height);
        Ok(self.blur_bands((&color.rgb, &mut out.rgb), depth, coc, None))
    }

    /// Blurs one picture of 16-bit codes in linear light of its tone curves.
    ///
    /// # Errors
    /// The same as for [`BandedBokeh::blur`].
    pub fn blur_16bit(
        &mut self,
        picture: &Picture16,
        depth: Option<&DepthMap>,
        coc: &CocField,
    ) -> Result<Picture16, BokehError> {
        check_frame(&self.plan, picture.size(), depth, coc)?;
        let mut out = Picture16::new(picture.size(), picture.curves.clone());
        self.blur_bands((&picture.rgb, &mut out.rgb), depth, coc, Some(create_encoder(picture)));
        Ok(out)
    }

    /// Blurs the pixels of one picture into others, with the results' encoder if it is not that of 8-bit sRGB.
    fn blur_bands<T: Sample>(
        &mut self,
        (from, into): (&[T], &mut [T]),
        depth: Option<&DepthMap>,
        coc: &CocField,
        encoder: Option<Arc<Encoder>>,
    ) -> PassTimes {
        let (width, height) = (self.plan.width, self.plan.height);
        self.plan.split_by_depth(depth, coc);
        let (mut times, mut clock) = (PassTimes::new(), Instant::now());
        let mut lap = |name| {
            let now = Instant::now();
            times.add(name, now - clock);
            clock = now;
            ControlFlow::Continue(())
        };
        let mut executor: Option<CpuBokeh> = None;
        let mut result = Vec::new();
        for (rows, around) in split_into_bands(height, self.rows, self.plan.support_rows()) {
            let wanted = rows.start - around.start..rows.end - around.start;
            let plan = self.plan.for_band(around.len(), wanted.clone());
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
            let radii = self.plan.band_radii(depth, coc, around.clone());
            // New memory takes pages only for the rows that are written.
            resize_buffer(&mut result, around.len() * width * 3);
            if let Some(encoder) = &encoder {
                executor.encoder = Arc::clone(encoder);
            }
            let pixels = &from[around.start * width * 3..around.end * width * 3];
            let _never_stopped = executor.blur_pixels(pixels, radii.as_radii(), &mut result, &mut lap);
            into[rows.start * width * 3..rows.end * width * 3]
                .copy_from_slice(&result[wanted.start * width * 3..wanted.end * width * 3]);
        }
        times
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

impl BandRadii {
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
    fn band_radii(&self, depth: Option<&DepthMap>, coc: &CocField, rows: Range<usize>) -> BandRadii {
        let (width, height) = (self.width, self.height);
        match (coc, depth) {
            (CocField::Ramp(ramp), _) => {
                let row = |y| (0..width).map(move |x| ramp.coc_px(x as f32, y as f32));
                BandRadii::Each(rows.flat_map(row).collect())
            }
            (CocField::Depth(_), Some(map)) if !map.metres.is_empty() => {
                let columns = map.width as usize;
                let mut band = DepthMap::default();
                band.resize(map.width, rows.len() as u32);
                for (out, y) in band.metres.chunks_exact_mut(columns).zip(rows.clone()) {
                    let from = nearest_sample(y, height, map.height as usize);
                    out.copy_from_slice(&map.metres[from * columns..][..columns]);
                }
                (band.subject_m, band.is_smooth) = (map.subject_m, map.is_smooth);
                if let Some(matte) = self.matte(depth, coc) {
                    let first = (rows.start * width) as u32;
                    let pixels = matte.pixels_in(rows.start * width..rows.end * width);
                    let moved = pixels.iter().map(|pixel| MixedPixel { at: pixel.at - first, ..*pixel });
                    band.matte = Matte { pixels: moved.collect() };
                }
                BandRadii::Depth(*coc, Box::new(band))
            }
            _ => BandRadii::Uniform(*coc),
        }
    }
}

impl Bokeh for BandedBokeh {
    fn submit(&mut self, mut job: Job) -> Result<(), BokehError> {
        self.plan.set_quality(job.quality);
        let times = self.blur(&job.color, job.depth.as_deref(), &job.coc, &mut job.out)?;
        let Job { ticket, color, depth, out, .. } = job;
        let picture = Picture::from_memory(out);
        self.done = Some(BlurredFrame { ticket, picture, color, depth, times, reused: 0.0 });
        Ok(())
    }

    fn collect(&mut self, _wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        Ok(self.done.take())
    }

    fn in_flight(&self) -> usize {
        usize::from(self.done.is_some())
    }

    fn capacity(&self) -> usize {
        1
    }

    fn backend(&self) -> Backend {
        Backend::Cpu
    }

    fn describe(&self) -> String {
        describe(self.threads, Arch::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

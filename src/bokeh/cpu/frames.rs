//! The `Bokeh` interface of the CPU executor: one frame in, one frame out.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use pulp::Arch;

use super::encode::{EncodeTable, Encoder};
use super::{CpuBokeh, Radii, Sample};
use crate::bokeh::plan::Plan;
use crate::bokeh::{BlurredFrame, Bokeh, BokehError, Job, PassTimes, Picture};
use crate::color::Picture16;
use crate::compute::{Backend, simd};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

impl CpuBokeh {
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
        Ok(self.blur_timed(&color.rgb, Radii::Field(coc, depth), &mut out.rgb))
    }

    /// Blurs one picture of 16-bit codes in linear light of its tone curves.
    ///
    /// # Errors
    /// The same as for [`CpuBokeh::blur`].
    pub fn blur_16bit(
        &mut self,
        picture: &Picture16,
        depth: Option<&DepthMap>,
        coc: &CocField,
    ) -> Result<Picture16, BokehError> {
        check_frame(&self.plan, picture.size(), depth, coc)?;
        self.encoder = create_encoder(picture);
        let mut out = Picture16::new(picture.size(), picture.curves.clone());
        self.blur_timed(&picture.rgb, Radii::Field(coc, depth), &mut out.rgb);
        Ok(out)
    }

    fn blur_timed<T: Sample>(&mut self, pixels: &[T], coc: Radii<'_>, out: &mut [T]) -> PassTimes {
        let mut times = PassTimes::new();
        let mut clock = Instant::now();
        let lap = |name| {
            let now = Instant::now();
            times.add(name, now - clock);
            clock = now;
            ControlFlow::Continue(())
        };
        let _never_stopped = self.blur_pixels(pixels, coc, out, lap);
        times
    }
}

impl Bokeh for CpuBokeh {
    fn submit(&mut self, mut job: Job) -> Result<(), BokehError> {
        self.plan.set_quality(job.quality);
        let times = self.blur(&job.color, job.depth.as_deref(), &job.coc, &mut job.out)?;
        let Job { ticket, color, depth, out, .. } = job;
        let reused = self.kept_fraction;
        self.done = Some(BlurredFrame { ticket, picture: Picture::from_memory(out), color, depth, times, reused });
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
        describe(self.workers.thread_count(), self.arch)
    }
}

/// Refuses a picture of another size than the plan's, and one without the depth that `coc` needs.
pub(super) fn check_frame(
    plan: &Plan,
    got: (u32, u32),
    depth: Option<&DepthMap>,
    coc: &CocField,
) -> Result<(), BokehError> {
    let made_for = (plan.width as u32, plan.height as u32);
    if got != made_for {
        return Err(BokehError::Size { made_for, got });
    }
    match (coc, depth) {
        (CocField::Depth(_), None) => Err(BokehError::NoDepth),
        _ => Ok(()),
    }
}

/// Creates the encoder for results of `picture`.
pub(super) fn create_encoder(picture: &Picture16) -> Arc<Encoder> {
    Arc::new(Encoder { table: EncodeTable::new(), curves: Some(picture.curves.clone()) })
}

/// Describes the executor in one line.
pub(super) fn describe(threads: usize, arch: Arch) -> String {
    format!("cpu, {threads} threads, {}", simd::instruction_set(arch))
}

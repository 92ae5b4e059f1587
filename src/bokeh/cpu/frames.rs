//! The `Bokeh` interface of the CPU executor: one frame in, one frame out.

use std::ops::ControlFlow;
use std::time::Instant;

use pulp::Arch;

use super::{CpuBokeh, Radii};
use crate::bokeh::{BlurredFrame, Bokeh, BokehError, Job, PassTimes, Picture};
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
        let made_for = (self.plan.width as u32, self.plan.height as u32);
        if color.size() != made_for {
            return Err(BokehError::Size { made_for, got: color.size() });
        }
        if matches!(coc, CocField::Depth(_)) && depth.is_none() {
            return Err(BokehError::NoDepth);
        }
        out.resize(color.width, color.height);
        let mut times = PassTimes::new();
        let mut clock = Instant::now();
        let lap = |name| {
            let now = Instant::now();
            times.add(name, now - clock);
            clock = now;
            ControlFlow::Continue(())
        };
        let _never_stopped = self.blur_pixels(&color.rgb, Radii::Field(coc, depth), &mut out.rgb, lap);
        Ok(times)
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

/// Describes the executor in one line.
pub(super) fn describe(threads: usize, arch: Arch) -> String {
    format!("cpu, {threads} threads, {}", simd::instruction_set(arch))
}

//! The `Bokeh` interface of the CPU executor: one frame in, one frame out.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use pulp::Arch;

use super::encode::Encoder;
use super::{BandedBokeh, CpuBokeh, Radii};
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
        self.plan.check_frame(color.size(), depth, coc)?;
        out.resize(color.width, color.height);
        Ok(time_passes(|lap| self.blur_pixels(&color.rgb, Radii::Field(coc, depth), &mut out.rgb, lap)))
    }
}

impl BandedBokeh {
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
        self.plan.check_frame(picture.size(), depth, coc)?;
        self.encoder = Some(Arc::new(Encoder { curves: Some(picture.curves.clone()) }));
        let mut out = Picture16::new(picture.size(), picture.curves.clone());
        time_passes(|lap| self.blur_pixels(&picture.rgb, Radii::Field(coc, depth), &mut out.rgb, lap));
        Ok(out)
    }
}

/// Runs the passes of a frame, which is never stopped; returns their times.
fn time_passes(run: impl FnOnce(&mut dyn FnMut(&'static str) -> ControlFlow<()>) -> ControlFlow<()>) -> PassTimes {
    let mut times = PassTimes::new();
    let mut clock = Instant::now();
    let _never_stopped = run(&mut |name| {
        let now = Instant::now();
        times.add(name, now - clock);
        clock = now;
        ControlFlow::Continue(())
    });
    times
}

impl Bokeh for BandedBokeh {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        let Job { ticket, color, depth, coc, quality, mut out, .. } = job;
        self.plan.check_frame(color.size(), depth.as_deref(), &coc)?;
        self.set_quality(quality);
        out.resize(color.width, color.height);
        let radii = Radii::Field(&coc, depth.as_deref());
        let times = time_passes(|lap| self.blur_pixels(&color.rgb, radii, &mut out.rgb, lap));
        self.done = Some(BlurredFrame { ticket, picture: Picture::from_memory(out), color, depth, times });
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
        format!("cpu, {} threads, {}", self.thread_count(), simd::instruction_set(Arch::new()))
    }
}

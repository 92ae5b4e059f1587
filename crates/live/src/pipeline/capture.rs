//! First stage: reads frames at their pace.

use std::sync::atomic::{AtomicBool, Ordering};

use super::frame::Frame;
use super::pacer::Pacer;
use super::{Shared, StageResult, Trace};
use crate::capture::{self, Camera, CaptureError, Captured, FrameData, MAX_WAIT};
use crate::stats::{DropCause, Histogram};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam::link::Sender;
use bokehcam::link::demand::Demand;
use bokehcam::link::pool::Pooled;

/// A picture, with the depth or right picture that the camera delivered.
pub(super) struct CapturedFrame {
    pub color: Pooled<ColorImage>,
    pub depth: Option<Pooled<DepthMap>>,
    /// The right camera's picture.
    pub right: Option<Pooled<GrayImage>>,
    /// How far the source's own time is ahead of media time, in nanoseconds.
    pub ahead_ns: i64,
}

pub(super) struct Stage<'a> {
    camera: Box<dyn Camera>,
    pacer: Pacer,
    /// `None` captures even if there are no viewers.
    demand: Option<Demand>,
    /// The user's stop flag, and the flag that another stage has ended.
    stop: [&'a AtomicBool; 2],
    shared: &'a Shared,
    times: &'a mut Histogram,
}

impl<'a> Stage<'a> {
    pub(super) fn new(
        mut camera: Box<dyn Camera>,
        demand: Option<Demand>,
        stop: &'a AtomicBool,
        shared: &'a Shared,
        times: &'a mut Histogram,
    ) -> Self {
        let Shared { clock, info, realtime_period_ns, has_ended, .. } = shared;
        let pacer = Pacer::new(clock.clone(), realtime_period_ns.is_some() && !info.live, info.period_ns);
        if let Some((seeker, demand)) = camera.seeker().zip(demand.as_ref()) {
            seeker.set_demand(demand);
        }
        Self { camera, pacer, demand, stop: [stop, has_ended], shared, times }
    }

    /// Suspends the camera for a moment if there are no viewers; returns whether it did.
    fn pause(&mut self) -> bool {
        let Some(demand) = self.demand.as_ref().filter(|demand| !demand.is_watched()) else { return false };
        self.camera.suspend();
        let pause_began_ns = self.shared.clock.now_ns();
        demand.wait(MAX_WAIT);
        self.pacer.shift_schedule(self.shared.clock.now_ns() - pause_began_ns);
        true
    }

    /// Counts a frame that cannot be decoded, and warns of the first one.
    ///
    /// # Errors
    /// Such frames end the run.
    fn skip_corrupt(&self, error: CaptureError, has_warned: &mut bool) -> StageResult {
        self.shared.counter.count_lost(1, DropCause::Corrupt);
        if !self.shared.keep_going {
            return Err(error.into());
        }
        if !std::mem::replace(has_warned, true) {
            tracing::warn!("{error}; such frames are skipped");
        }
        Ok(())
    }

    /// Captures until the camera ends, a stop flag is set, or the output is closed.
    pub(super) fn run(mut self, mut to: Sender<Frame<CapturedFrame>>) -> StageResult {
        let (Shared { clock, counter, pools, info, .. }, stop) = (self.shared, self.stop);
        let stopped = || stop.iter().any(|stop| stop.load(Ordering::Relaxed));
        // Stand-ins for a camera that brings neither; they stay empty.
        let (mut no_depth, mut no_right) = (DepthMap::default(), GrayImage::default());
        let seeker = self.camera.seeker();
        let (mut seek, mut ahead_ns, mut has_warned) = (0, 0, false);
        while !stopped() {
            let request = seeker.as_ref().and_then(|seeker| seeker.newer_request(seek));
            if let Some(request) = request {
                (seek, ahead_ns) = (request.number, self.camera.seek(request.position));
                self.pacer.restart_schedule();
            // A seek is served even if there are no viewers; otherwise the camera pauses until one comes.
            } else if self.pause() {
                continue;
            }
            counter.count_lost(self.pacer.skip_late_frames(&mut *self.camera), DropCause::Driver);
            let mut color = pools.colors.take();
            let mut depth = (info.frame_data == FrameData::Depth).then(|| pools.depths.take());
            let mut right = (info.frame_data == FrameData::RightCamera).then(|| pools.rights.take());
            let shot = capture::FrameBuffers {
                color: &mut color,
                depth: depth.as_deref_mut().unwrap_or(&mut no_depth),
                right: right.as_deref_mut().unwrap_or(&mut no_right),
            };
            let began_ns = clock.now_ns();
            match self.camera.next(shot)? {
                Captured::Frame(stamp) => {
                    let read_ns = (clock.now_ns() - began_ns).saturating_sub(self.camera.waited_ns());
                    self.times.add(read_ns);
                    // A live camera stamps its frames; stored ones are captured when they are due.
                    let has_request = || seeker.as_ref().is_some_and(|seeker| seeker.newer_request(seek).is_some());
                    let captured_ns = match stamp.captured_ns {
                        Some(captured_ns) => captured_ns,
                        None => self.pacer.wait_until_due(stamp.time_ns, read_ns, || stopped() || has_request()),
                    };
                    let ticket = counter.count_captured(captured_ns);
                    let frame = Frame {
                        ticket,
                        stamp,
                        seek,
                        is_seek_target: request.is_some(),
                        change: 0,
                        is_transitional: false,
                        trace: Trace::default(),
                        since_ns: clock.now_ns(),
                        item: CapturedFrame { color, depth, right, ahead_ns },
                    };
                    if !frame.send_to(&mut to, counter) {
                        break;
                    }
                }
                Captured::Corrupt(error) => self.skip_corrupt(error, &mut has_warned)?,
                Captured::Lost(count, cause) => counter.count_lost(count, cause),
                Captured::Waiting => {}
                Captured::End => break,
            }
        }
        Ok(())
    }
}

//! Second stage: computes depth and CoC of each frame; changes of the blur take effect here.

use std::mem;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::capture::CapturedFrame;
use super::change::{Change, ExecutorChange, ExecutorSwap};
use super::depth_schedule::DepthScheduler;
use super::frame::Frame;
use super::{Fault, Shared, StageResult};
use crate::stats::{DepthTimings, DropCause};
use bokehcam::budget::DepthTimes;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::engine::{Composed, Preprocessor};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam::link::pool::Pooled;
use bokehcam::link::{Received, Receiver, Sender};
use bokehcam::optics::CocField;

/// After this time without a frame there are no viewers, and a depth camera may pause.
const IDLE: Duration = Duration::from_secs(3);

/// Everything that the blur needs of a frame.
pub(super) struct Prepared {
    pub color: Pooled<ColorImage>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
    pub composed: Composed,
    /// Times of its depth; `None` if it has none.
    pub times: Option<DepthTimes>,
    /// The last change of the executor, if any: every later frame carries it.
    pub swap: Option<Arc<ExecutorSwap>>,
}

pub(super) struct Stage<'a> {
    preprocessor: Preprocessor,
    source: Option<Box<dyn DepthSource>>,
    /// The changes of the blur, and whether executors support every quality.
    changes: (Option<mpsc::Receiver<Change>>, bool),
    /// Effort and rate of depth; `None` computes full-effort depth for every frame.
    scheduler: Option<DepthScheduler<'a>>,
    shared: &'a Shared,
    times: &'a mut DepthTimings,
    /// The number of the last change, and whether its executor is still being created.
    change: (u64, bool),
    swap: Option<Arc<ExecutorSwap>>,
    /// The number of the last seek in the source.
    seek: u64,
}

/// A frame's depth and CoC; no depth if the CoC is the same for every frame.
type Made = (Option<Pooled<DepthMap>>, CocField);

impl<'a> Stage<'a> {
    pub(super) fn new(
        preprocessor: Preprocessor,
        source: Option<Box<dyn DepthSource>>,
        changes: (Option<mpsc::Receiver<Change>>, bool),
        shared: &'a Shared,
        times: &'a mut DepthTimings,
    ) -> Self {
        let scheduler = shared.realtime_period_ns.map(|_| DepthScheduler::new(&shared.plan));
        Self { preprocessor, source, changes, scheduler, shared, times, change: (0, false), swap: None, seek: 0 }
    }

    /// Runs until the input ends or the output is closed. Changes of the blur take effect between frames.
    pub(super) fn run(
        mut self,
        mut from: Receiver<Frame<CapturedFrame>>,
        mut to: Sender<Frame<Prepared>>,
    ) -> StageResult {
        let Shared { clock, counter, .. } = self.shared;
        let mut has_warned = false;
        loop {
            let frame = match from.recv_timeout(IDLE) {
                Received::Item(frame) => frame,
                Received::Ended => return Ok(()),
                Received::Nothing => {
                    self.source.iter_mut().for_each(|source| source.suspend());
                    continue;
                }
            };
            self.apply_changes();
            if mem::replace(&mut self.seek, frame.seek) != frame.seek {
                self.handle_seek(frame.item.ahead_ns);
            }
            let (mut frame, CapturedFrame { mut color, depth, right, .. }) = frame.take_item(clock.now_ns());
            let reused_before = self.times.reused;
            let (depth, coc) = match self.compute_depth_and_coc(depth, right, &mut color, frame.stamp) {
                Ok(made) => made,
                Err(fault) => {
                    let (cause, goes_on) = match &fault {
                        // A depth camera without a map so far will deliver one soon.
                        Fault::Depth(DepthError::Unpaired { .. }) => (DropCause::Unpaired, true),
                        Fault::Depth(_) => (DropCause::Corrupt, self.shared.keep_going),
                        _ => (DropCause::Failed, false),
                    };
                    counter.count_dropped(frame.ticket, cause);
                    if !goes_on {
                        return Err(fault);
                    }
                    if !mem::replace(&mut has_warned, true) {
                        tracing::warn!("{fault}; such frames are skipped");
                    }
                    continue;
                }
            };
            self.times.refined_by = self.preprocessor.refinement_backend().or(self.times.refined_by);
            self.times.matted_by = self.preprocessor.matting_backend().or(self.times.matted_by);
            (frame.change, frame.is_transitional) = self.change;
            frame.trace.is_depth_reused = self.times.reused > reused_before;
            if !self.compose_frame(frame, color, depth, coc).send_to(&mut to, counter) {
                return Ok(());
            }
        }
    }

    /// Applies the changes that have arrived.
    fn apply_changes(&mut self) {
        let (changes, adaptive) = &self.changes;
        for Change { number, look, bokeh } in changes.iter().flat_map(mpsc::Receiver::try_iter) {
            self.preprocessor.set_look(&look);
            self.change = (number, matches!(bokeh, ExecutorChange::KeepUntilReady));
            self.scheduler.iter_mut().for_each(DepthScheduler::discard_held_depth);
            if let ExecutorChange::Replace(executor) = bokeh {
                self.preprocessor.use_blur_device(executor.as_deref());
                let number = self.swap.as_ref().map_or(1, |last| last.number + 1);
                self.swap = Some(Arc::new(ExecutorSwap::new(number, executor, look.quality_rule(*adaptive))));
            }
        }
        let finds_subject = self.preprocessor.focuses_on_subject();
        if let Some(source) = &mut self.source {
            source.set_focus_on_persons(finds_subject);
        }
    }

    /// Drops all history after a seek in the source.
    fn handle_seek(&mut self, ahead_ns: i64) {
        self.preprocessor.clear_history();
        self.scheduler.iter_mut().for_each(DepthScheduler::discard_held_depth);
        self.source.iter_mut().for_each(|source| source.seek(ahead_ns));
    }

    /// Applies virtual background and auto-framing, the last step here, and stamps the frame's depth time.
    fn compose_frame(
        &mut self,
        mut frame: Frame<()>,
        mut color: Pooled<ColorImage>,
        mut depth: Option<Pooled<DepthMap>>,
        coc: CocField,
    ) -> Frame<Prepared> {
        let Shared { clock, pools, is_viewed, .. } = self.shared;
        let (originals, time_ns) = (is_viewed.then_some(&pools.original), frame.stamp.time_ns);
        let composed = depth
            .as_mut()
            .map(|map| self.preprocessor.compose(&mut color, map, &coc, time_ns, originals, || pools.kept.take()));
        let (began_ns, at_ns) = (mem::replace(&mut frame.since_ns, clock.now_ns()), frame.since_ns);
        frame.trace.depth_ns = at_ns - began_ns;
        let times = depth.is_some().then(|| DepthTimes {
            effort: (!frame.trace.is_depth_reused).then(|| self.scheduler.as_ref().map_or(0, DepthScheduler::effort)),
            took_ns: frame.trace.depth_ns,
            age_ns: began_ns.saturating_sub(frame.ticket.captured_ns),
            at_ns,
        });
        let swap = self.swap.clone();
        frame.with_item(Prepared { color, depth, coc, composed: composed.unwrap_or_default(), times, swap })
    }

    /// Computes the frame's depth and CoC, or reuses those of an earlier frame if time is short. A CoC that is the same
    /// for every frame needs no depth.
    fn compute_depth_and_coc(
        &mut self,
        brought: Option<Pooled<DepthMap>>,
        right: Option<Pooled<GrayImage>>,
        color: &mut ColorImage,
        stamp: Stamp,
    ) -> Result<Made, Fault> {
        let Shared { clock, pools, output_request, info, .. } = self.shared;
        let began_ns = clock.now_ns();
        // Also without depth: the picture's geometry and size do not change with the look.
        if let Some(source) = &mut self.source {
            source.rectify(color);
        }
        if let Some(field) = self.preprocessor.fixed_coc() {
            return Ok((None, field));
        }
        if output_request.as_ref().is_some_and(|output_request| output_request.requires_own_depth()) {
            self.scheduler.iter_mut().for_each(DepthScheduler::discard_held_depth);
        }
        if let Some((field, scheduler)) =
            self.scheduler.as_mut().and_then(|scheduler| Some((scheduler.reuse_next(color)?, scheduler)))
        {
            let mut map = brought.unwrap_or_else(|| pools.depths.take());
            scheduler.warp_reused(&mut map, color);
            self.preprocessor.adapt_reused_map(&mut map, color, &field);
            self.times.reused += 1;
            return Ok((Some(map), field));
        }
        let seen = FrameInput { stamp, color, right: right.as_deref() };
        let mut map = brought.map_or_else(|| self.read_map(seen), Ok)?;
        let field = self.preprocessor.compute_coc(&mut map, color, stamp.time_ns);
        self.preprocessor.take_warning().into_iter().for_each(|remark| tracing::warn!("{}: {remark}", info.name));
        self.times.took.add(clock.now_ns() - began_ns);
        if let Some(scheduler) = &mut self.scheduler {
            scheduler.store_depth(&map, field, color);
        }
        Ok((Some(map), field))
    }

    /// Reads a depth map from the source, with the effort that the time allows.
    fn read_map(&mut self, seen: FrameInput) -> Result<Pooled<DepthMap>, Fault> {
        let Shared { pools, info, .. } = self.shared;
        let source = self.source.as_mut().ok_or_else(|| Fault::NoDepth { source_name: info.name.clone() })?;
        if let Some(scheduler) = &self.scheduler {
            source.set_effort(scheduler.effort());
        }
        let mut map = pools.depths.take();
        source.read(seen, &mut map)?;
        Ok(map)
    }
}

//! Second stage: computes depth and CoC of each frame; changes of the blur take effect here.

use std::mem;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::capture::Shot;
use super::change::{Change, Executor, Swap};
use super::frame::Frame;
use super::rate::Rate;
use super::{Ended, Fault, Shared};
use crate::budget::DepthTimes;
use crate::depth::{DepthError, DepthSource, FrameInput};
use crate::engine::{Preprocessor, Staged};
use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use crate::link::pool::Pooled;
use crate::link::{Received, Receiver, Sender};
use crate::optics::CocField;
use crate::stats::{Cause, DepthTimings};

/// After this time without a frame there are no viewers, and a depth camera may pause.
const IDLE: Duration = Duration::from_secs(3);

/// Everything that the blur needs of a frame.
pub(super) struct Ready {
    pub color: Pooled<ColorImage>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
    pub staged: Staged,
    /// Times of its depth; `None` if it has none.
    pub times: Option<DepthTimes>,
    /// The last change of the executor, if any: every later frame carries it.
    pub swap: Option<Arc<Swap>>,
}

pub(super) struct Stage<'a> {
    preparation: Preprocessor,
    source: Option<Box<dyn DepthSource>>,
    /// The changes of the blur, and whether executors support every quality.
    changes: (Option<mpsc::Receiver<Change>>, bool),
    /// Effort and rate of depth; `None` computes full-effort depth for every frame.
    rate: Option<Rate<'a>>,
    shared: &'a Shared,
    times: &'a mut DepthTimings,
    /// The number of the last change, and whether its executor is still being created.
    change: (u64, bool),
    swap: Option<Arc<Swap>>,
    /// The number of the last seek in the source.
    seek: u64,
}

/// A frame's depth and CoC; no depth if the CoC is the same for every frame.
type Made = (Option<Pooled<DepthMap>>, CocField);

impl<'a> Stage<'a> {
    pub(super) fn new(
        preparation: Preprocessor,
        source: Option<Box<dyn DepthSource>>,
        changes: (Option<mpsc::Receiver<Change>>, bool),
        shared: &'a Shared,
        times: &'a mut DepthTimings,
    ) -> Self {
        let rate = shared.live_ns.map(|_| Rate::new(&shared.order));
        Self { preparation, source, changes, rate, shared, times, change: (0, false), swap: None, seek: 0 }
    }

    /// Runs until the input ends or the output is closed. Changes of the blur take effect between frames.
    pub(super) fn run(mut self, mut from: Receiver<Frame<Shot>>, mut to: Sender<Frame<Ready>>) -> Ended {
        let Shared { clock, tally, .. } = self.shared;
        let mut complained = false;
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
            let (mut frame, Shot { mut color, depth, right, .. }) = frame.take_item(clock.now_ns());
            let held_before = self.times.held;
            let (depth, coc) = match self.depth_and_coc((depth, right), &mut color, frame.stamp) {
                Ok(made) => made,
                Err(fault) => {
                    let (cause, goes_on) = match &fault {
                        // A depth camera without a map so far will deliver one soon.
                        Fault::Depth(DepthError::Unpaired { .. }) => (Cause::Unpaired, true),
                        Fault::Depth(_) => (Cause::Corrupt, self.shared.keep_going),
                        _ => (Cause::Failed, false),
                    };
                    tally.dropped(frame.ticket, cause);
                    if !goes_on {
                        return Err(fault);
                    }
                    if !mem::replace(&mut complained, true) {
                        tracing::warn!("{fault}; going on without such frames");
                    }
                    continue;
                }
            };
            self.times.refined_by = self.preparation.refined_by().or(self.times.refined_by);
            self.times.matted_by = self.preparation.matted_by().or(self.times.matted_by);
            (frame.change, frame.is_between) = self.change;
            frame.trace.depth_held = self.times.held > held_before;
            if !self.stage_frame(frame, color, depth, coc).send_to(&mut to, tally) {
                return Ok(());
            }
        }
    }

    /// Applies the changes that have arrived.
    fn apply_changes(&mut self) {
        let (changes, adaptive) = &self.changes;
        for Change { number, look, bokeh } in changes.iter().flat_map(mpsc::Receiver::try_iter) {
            self.preparation.follow(&look);
            self.change = (number, matches!(bokeh, Executor::Meanwhile));
            self.rate.iter_mut().for_each(Rate::forget);
            if let Executor::To(executor) = bokeh {
                self.preparation.beside(executor.as_deref());
                let number = self.swap.as_ref().map_or(1, |last| last.number + 1);
                self.swap = Some(Arc::new(Swap::new(number, executor, look.quality_rule(*adaptive))));
            }
        }
        let finds_subject = self.preparation.focuses_on_subject();
        self.source.iter_mut().for_each(|source| source.set_focus_on_persons(finds_subject));
    }

    /// Drops all history after a seek in the source.
    fn handle_seek(&mut self, ahead_ns: i64) {
        self.preparation.forget();
        self.rate.iter_mut().for_each(Rate::forget);
        self.source.iter_mut().for_each(|source| source.seek(ahead_ns));
    }

    /// Applies virtual background and auto-framing, the last step here, and stamps the frame's depth time.
    fn stage_frame(
        &mut self,
        mut frame: Frame<()>,
        mut color: Pooled<ColorImage>,
        mut depth: Option<Pooled<DepthMap>>,
        coc: CocField,
    ) -> Frame<Ready> {
        let Shared { clock, pools, is_viewed, .. } = self.shared;
        let kept = is_viewed.then_some(&pools.original);
        let staged = depth.as_mut().map(|map| self.preparation.stage(&mut color, map, &coc, frame.stamp.time_ns, kept));
        let (began_ns, at_ns) = (mem::replace(&mut frame.since_ns, clock.now_ns()), frame.since_ns);
        frame.trace.depth_ns = at_ns - began_ns;
        let times = depth.is_some().then(|| DepthTimes {
            effort: (!frame.trace.depth_held).then(|| self.rate.as_ref().map_or(0, Rate::effort)),
            took_ns: frame.trace.depth_ns,
            age_ns: began_ns.saturating_sub(frame.ticket.captured_ns),
            at_ns,
        });
        let swap = self.swap.clone();
        frame.with(Ready { color, depth, coc, staged: staged.unwrap_or_default(), times, swap })
    }

    /// Computes the frame's depth and CoC, or reuses those of an earlier frame if time is short. A CoC that is the same
    /// for every frame needs no depth.
    fn depth_and_coc(
        &mut self,
        (brought, right): (Option<Pooled<DepthMap>>, Option<Pooled<GrayImage>>),
        color: &mut ColorImage,
        stamp: Stamp,
    ) -> Result<Made, Fault> {
        let Shared { clock, pools, wanted, info, .. } = self.shared;
        if let Some(field) = self.preparation.fixed() {
            return Ok((None, field));
        }
        let began_ns = clock.now_ns();
        if let Some(source) = &mut self.source {
            source.rectify(color);
        }
        if wanted.as_ref().is_some_and(|wanted| wanted.wants_own_depth()) {
            self.rate.iter_mut().for_each(Rate::forget);
        }
        if let Some((field, rate)) = self.rate.as_mut().and_then(|rate| Some((rate.next_held()?, rate))) {
            let mut map = brought.unwrap_or_else(|| pools.depths.take());
            rate.warp_held(&mut map, color);
            self.preparation.share(&mut map, color, &field);
            self.times.held += 1;
            return Ok((Some(map), field));
        }
        let seen = FrameInput { stamp, color, right: right.as_deref() };
        let mut map = brought.map_or_else(|| self.read_map(seen), Ok)?;
        let field = self.preparation.make(&mut map, color, stamp.time_ns);
        self.preparation.remark().into_iter().for_each(|remark| tracing::warn!("{}: {remark}", info.name));
        self.times.took.add(clock.now_ns() - began_ns);
        if let Some(rate) = &mut self.rate {
            rate.keep((&map, field), color);
        }
        Ok((Some(map), field))
    }

    /// Reads a depth map from the source, with the effort that the time allows.
    fn read_map(&mut self, seen: FrameInput) -> Result<Pooled<DepthMap>, Fault> {
        let Shared { pools, info, .. } = self.shared;
        let source = self.source.as_mut().ok_or_else(|| Fault::NoDepth { source_name: info.name.clone() })?;
        if let Some(rate) = &self.rate {
            source.set_effort(rate.effort());
        }
        let mut map = pools.depths.take();
        source.read(seen, &mut map)?;
        Ok(map)
    }
}

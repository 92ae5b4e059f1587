//! Second stage: gives each frame its depth and its CoC; here a change of the blur begins.

use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::capture::Shot;
use super::change::{Change, Executor, Swap};
use super::prepare::Preparation;
use super::rate::Rate;
use super::staging::Taken;
use super::wanted::Wanted;
use super::{Ended, Fault, Frame, hand_on};
use crate::budget::DepthTimes;
use crate::clock::Clock;
use crate::compute::DeviceFrame;
use crate::depth::{DepthError, DepthSource, Seen};
use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use crate::link::pool::{Pool, Pooled};
use crate::link::{Received, Receiver, Sender};
use crate::optics::CocField;
use crate::stats::{Cause, Histogram, Tally};

/// After this time without a frame nobody watches: a depth camera may rest.
const IDLE: Duration = Duration::from_secs(3);

/// All that the blur needs of a frame.
pub(super) struct Ready {
    pub color: Pooled<ColorImage>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
    /// The picture and its depth, where a device has refined that.
    pub on_device: Option<Pooled<DeviceFrame>>,
    /// The picture and its depth before something else stood behind the subject, where that is so and somebody looks at them.
    pub taken: Option<Pooled<Taken>>,
    /// What its depth took; `None` where it has none.
    pub times: Option<DepthTimes>,
    /// The last change of what blurs, if there was one: every frame since then brings it.
    pub swap: Option<Arc<Swap>>,
}

pub(super) struct Stage<'a> {
    /// Whether executors are made for every quality.
    pub adaptive: bool,
    pub changes: Option<mpsc::Receiver<Change>>,
    pub source: Option<Box<dyn DepthSource>>,
    pub source_name: &'a str,
    pub keep_going: bool,
    pub depths: &'a Pool<DepthMap>,
    /// Where frames are kept as they were taken, if somebody looks at them.
    pub taken: Option<&'a Pool<Taken>>,
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    /// How well and how often depth is made; `None` makes it as well as can be, for every frame.
    pub rate: Option<Rate<'a>>,
    pub times: &'a mut Histogram,
    /// Whether frames are wanted with depth of their own.
    pub wanted: Option<Arc<Wanted>>,
    /// Counts frames that took over the depth of the one before.
    pub held: &'a mut u64,
    /// Told what refines, and what finds mattes ([`Preparation::refined_by`], [`Preparation::matted_by`]).
    pub refined_by: &'a mut Option<&'static str>,
    pub matted_by: &'a mut Option<&'static str>,
}

impl Stage<'_> {
    /// Runs until the frames end or nobody takes the results. Changes of the blur take effect between frames.
    pub(super) fn run(
        mut self,
        mut preparation: Preparation,
        mut from: Receiver<Frame<Shot>>,
        mut to: Sender<Frame<Ready>>,
    ) -> Ended {
        let mut complained = false;
        let mut swap: Option<Arc<Swap>> = None;
        let (mut change, mut between) = (0, false);
        let mut seek = 0;
        loop {
            let Frame { ticket, stamp, mut trace, since_ns, item: Shot { mut color, depth, right, ahead_ns } } =
                match from.recv_timeout(IDLE) {
                    Received::Item(frame) => frame,
                    Received::Ended => break,
                    Received::Nothing => {
                        if let Some(source) = &mut self.source {
                            source.rest();
                        }
                        continue;
                    }
                };
            for Change { number, look, bokeh } in self.changes.iter().flat_map(mpsc::Receiver::try_iter) {
                preparation.follow(&look, self.knows_background());
                (change, between) = (number, matches!(bokeh, Executor::Meanwhile));
                self.rate.iter_mut().for_each(Rate::forget);
                if let Executor::To(executor) = bokeh {
                    preparation.beside(executor.as_deref());
                    let number = swap.map_or(1, |last| last.number + 1);
                    swap = Some(Arc::new(Swap::new(number, executor, look.quality_rule(self.adaptive))));
                }
            }
            self.source.iter_mut().for_each(|source| source.look_for_persons(preparation.focuses_on_subject()));
            if std::mem::replace(&mut seek, trace.seek) != trace.seek {
                preparation.forget();
                self.rate.iter_mut().for_each(Rate::forget);
                self.source.iter_mut().for_each(|source| source.jump(ahead_ns));
            }
            let began_ns = self.clock.now_ns();
            trace.between_ns += began_ns.saturating_sub(since_ns);
            let held_before = *self.held;
            // A CoC that is the same for every frame needs no depth.
            let made = match preparation.fixed() {
                Some(field) => Ok((None, field)),
                None => self
                    .depth_and_coc(&mut preparation, (depth, right), &mut color, stamp)
                    .map(|(map, field)| (Some(map), field)),
            };
            let (mut depth, coc) = match made {
                Ok(made) => made,
                Err(fault) => {
                    let (cause, goes_on) = match &fault {
                        // A depth camera that has given no map yet soon will.
                        Fault::Depth(DepthError::Unpaired { .. }) => (Cause::Unpaired, true),
                        Fault::Depth(_) => (Cause::Corrupt, self.keep_going),
                        _ => (Cause::Failed, false),
                    };
                    self.tally.dropped(ticket, cause);
                    if !goes_on {
                        return Err(fault);
                    }
                    if !complained {
                        tracing::warn!("{fault}; going on without such frames");
                        complained = true;
                    }
                    continue;
                }
            };
            *self.refined_by = preparation.refined_by().or(*self.refined_by);
            *self.matted_by = preparation.matted_by().or(*self.matted_by);
            (trace.change, trace.between) = (change, between);
            let taken = depth.as_deref().zip(self.taken.filter(|_| preparation.replaces(&coc))).map(|(map, pool)| {
                let mut taken = pool.take();
                taken.keep(&color, map);
                taken
            });
            // What is staged has another picture.
            let on_device = preparation.take_copy().filter(|_| !preparation.replaces(&coc));
            trace.part = depth.as_mut().and_then(|map| preparation.stage(&mut color, map, &coc, stamp.time_ns));
            let since_ns = self.clock.now_ns();
            (trace.depth_ns, trace.depth_held) = (since_ns - began_ns, *self.held > held_before);
            let effort = (!trace.depth_held).then(|| self.rate.as_ref().map_or(0, Rate::effort));
            let age_ns = began_ns.saturating_sub(ticket.captured_ns);
            let times = DepthTimes { effort, took_ns: trace.depth_ns, age_ns, at_ns: since_ns };
            let times = depth.is_some().then_some(times);
            let item = Ready { color, depth, coc, on_device, taken, times, swap: swap.clone() };
            let frame = Frame { ticket, stamp, trace, since_ns, item };
            if !hand_on(&mut to, frame, self.tally) {
                break;
            }
        }
        Ok(())
    }

    fn knows_background(&self) -> bool {
        self.source.as_ref().is_some_and(|source| source.knows_background())
    }

    /// The frame's depth and CoC: new ones, or those of the frame before where there is no time for more.
    fn depth_and_coc(
        &mut self,
        preparation: &mut Preparation,
        (brought, right): (Option<Pooled<DepthMap>>, Option<Pooled<GrayImage>>),
        color: &mut ColorImage,
        stamp: Stamp,
    ) -> Result<(Pooled<DepthMap>, CocField), Fault> {
        let began_ns = self.clock.now_ns();
        if let Some(source) = &mut self.source {
            source.rectify(color);
        }
        if self.wanted.as_ref().is_some_and(|wanted| wanted.wants_own_depth()) {
            self.rate.iter_mut().for_each(Rate::forget);
        }
        if let Some((field, rate)) = self.rate.as_mut().and_then(|rate| Some((rate.holds()?, rate))) {
            let mut map = brought.unwrap_or_else(|| self.depths.take());
            rate.give_held(&mut map, color);
            preparation.share(&mut map, color, &field);
            *self.held += 1;
            return Ok((map, field));
        }
        let seen = Seen { stamp, color, right: right.as_deref() };
        let mut map = brought.map_or_else(|| self.read(seen), Ok)?;
        let (field, remark) = preparation.make(&mut map, color, stamp.time_ns);
        remark.into_iter().for_each(|remark| tracing::warn!("{}: {remark}", self.source_name));
        let now_ns = self.clock.now_ns();
        self.times.add(now_ns - began_ns);
        if let Some(rate) = &mut self.rate {
            rate.made((&map, field), color);
        }
        Ok((map, field))
    }

    /// A depth map from the source, made with as much effort as there is time for.
    fn read(&mut self, seen: Seen) -> Result<Pooled<DepthMap>, Fault> {
        let Some(source) = &mut self.source else {
            return Err(Fault::NoDepth { source_name: self.source_name.to_owned() });
        };
        if let Some(rate) = &self.rate {
            source.set_effort(rate.effort());
        }
        let mut map = self.depths.take();
        source.read(seen, &mut map)?;
        Ok(map)
    }
}

//! Second stage: gives each frame its depth and its CoC; here a change of the blur begins.

use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::capture::Shot;
use super::change::{Change, Executor, Swap};
use super::rate::Rate;
use super::{CocAtInfinity, CocRule, Ended, Fault, Frame, hand_on};
use crate::clock::Clock;
use crate::depth::fill::Filler;
use crate::depth::focus::Focus;
use crate::depth::refine::Refiner;
use crate::depth::{DepthError, DepthSource, Seen};
use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use crate::link::pool::{Pool, Pooled};
use crate::link::{Received, Receiver, Sender};
use crate::optics::CocField;
use crate::stats::{Cause, Histogram, Tally};

/// Without a frame for so long, nobody watches: a depth camera may rest.
const IDLE: Duration = Duration::from_secs(3);

/// All that the blur needs of a frame.
pub(super) struct Ready {
    pub color: Pooled<ColorImage>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
    /// The last change of what blurs, if there was one: every frame since then brings it.
    pub swap: Option<Arc<Swap>>,
}

pub(super) struct Stage<'a> {
    pub coc: CocRule,
    pub refine: bool,
    pub changes: Option<mpsc::Receiver<Change>>,
    pub source: Option<Box<dyn DepthSource>>,
    pub source_name: &'a str,
    pub keep_going: bool,
    pub depths: &'a Pool<DepthMap>,
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    /// How well and how often depth is made; `None` makes it as well as can be, for every frame.
    pub rate: Option<Rate>,
    pub times: &'a mut Histogram,
    pub held: &'a mut u64,
}

/// A [`CocRule`] at work.
enum Coc {
    Fixed(CocField),
    Depth(Box<DepthCoc>),
}

struct DepthCoc {
    focus: Focus,
    maker: Maker,
    lens: CocAtInfinity,
    range_m: f32,
    max_coc_px: f32,
}

/// What makes a map for the blur of the depth that was measured.
enum Maker {
    Fill(Filler),
    Refine(Box<Refiner>),
}

impl Coc {
    fn new(rule: CocRule, refine: bool) -> Self {
        match rule {
            CocRule::Fixed(field) => Self::Fixed(field),
            CocRule::Depth { focus, lens, range_m, max_coc_px } => Self::Depth(Box::new(DepthCoc {
                focus: Focus::new(focus),
                maker: Maker::new(refine),
                lens,
                range_m,
                max_coc_px,
            })),
        }
    }

    /// Follows another rule, from where the lens stands now.
    fn follow(&mut self, rule: CocRule, refine: bool) {
        match (self, rule) {
            (Self::Depth(coc), CocRule::Depth { focus, lens, range_m, max_coc_px }) => {
                coc.focus.follow(focus);
                (coc.lens, coc.range_m, coc.max_coc_px) = (lens, range_m, max_coc_px);
                if refine != matches!(coc.maker, Maker::Refine(_)) {
                    coc.maker = Maker::new(refine);
                }
            }
            (coc, rule) => *coc = Self::new(rule, refine),
        }
    }
}

impl Maker {
    fn new(refine: bool) -> Self {
        if refine { Self::Refine(Box::new(Refiner::new())) } else { Self::Fill(Filler::new()) }
    }
}

impl DepthCoc {
    /// Focuses on what was measured, and only then makes up what was not.
    fn see(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> CocField {
        let focus_m = self.focus.focus_m(map, time_ns);
        match &mut self.maker {
            Maker::Fill(filler) => filler.fill_by(map, color),
            Maker::Refine(refiner) => {
                refiner.focus_at(focus_m);
                refiner.refine(map, color, time_ns);
            }
        }
        self.lens.field((focus_m, self.range_m), color.width, self.max_coc_px)
    }
}

impl Stage<'_> {
    pub(super) fn run(mut self, mut from: Receiver<Frame<Shot>>, mut to: Sender<Frame<Ready>>) -> Ended {
        let mut coc = Coc::new(self.coc, self.refine);
        let mut complained = false;
        let mut swap: Option<Arc<Swap>> = None;
        let mut change = 0;
        loop {
            let Frame { ticket, stamp, mut trace, item: Shot { mut color, depth, right } } =
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
            for Change { number, coc: rule, refine, quality, bokeh } in
                self.changes.iter().flat_map(mpsc::Receiver::try_iter)
            {
                coc.follow(rule, refine);
                change = number;
                self.rate.iter_mut().for_each(Rate::forget);
                if let Executor::To(executor) = bokeh {
                    let number = swap.map_or(1, |last| last.number + 1);
                    swap = Some(Arc::new(Swap::new(number, executor, quality)));
                }
            }
            let began_ns = self.clock.now_ns();
            let made = match &mut coc {
                Coc::Fixed(field) => Ok((None, *field)),
                Coc::Depth(coc) => {
                    self.see(coc, (depth, right), &mut color, stamp).map(|(map, field)| (Some(map), field))
                }
            };
            let (depth, coc) = match made {
                Ok(made) => made,
                Err(fault) => {
                    let (cause, goes_on) = match &fault {
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
            trace.change = change;
            trace.depth_ns = self.clock.now_ns() - began_ns;
            let frame = Frame { ticket, stamp, trace, item: Ready { color, depth, coc, swap: swap.clone() } };
            if !hand_on(&mut to, frame, self.tally) {
                break;
            }
        }
        Ok(())
    }

    /// The frame's depth and CoC: new ones, or those of the frame before where there is no time for more.
    fn see(
        &mut self,
        coc: &mut DepthCoc,
        (brought, right): (Option<Pooled<DepthMap>>, Option<Pooled<GrayImage>>),
        color: &mut ColorImage,
        stamp: Stamp,
    ) -> Result<(Pooled<DepthMap>, CocField), Fault> {
        let began_ns = self.clock.now_ns();
        if let Some(source) = &mut self.source {
            source.straighten(color);
        }
        if let Some((field, rate)) = self.rate.as_mut().and_then(|rate| Some((rate.holds()?, rate))) {
            let mut map = brought.unwrap_or_else(|| self.depths.take());
            rate.copy_held(&mut map);
            *self.held += 1;
            return Ok((map, field));
        }
        let seen = Seen { stamp, color, right: right.as_deref() };
        let mut map = brought.map_or_else(|| self.read(seen), Ok)?;
        let field = coc.see(&mut map, color, stamp.time_ns);
        let now_ns = self.clock.now_ns();
        self.times.add(now_ns - began_ns);
        if let Some(rate) = &mut self.rate {
            rate.made((&map, field), now_ns - began_ns, now_ns);
        }
        Ok((map, field))
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::focus::FocusRule;

    #[test]
    fn depth_is_refined_while_that_is_wanted_and_by_one_refiner() {
        let focus = FocusRule::Point { x: 0.5, y: 0.5 };
        let rule = CocRule::Depth { focus, lens: CocAtInfinity::Px(8.0), range_m: 0.0, max_coc_px: 20.0 };
        let mut coc = Coc::new(rule, false);
        let mut refiner_after = |refine| {
            coc.follow(rule, refine);
            match &coc {
                Coc::Depth(depth) => match &depth.maker {
                    Maker::Refine(refiner) => Some(std::ptr::from_ref(&**refiner)),
                    Maker::Fill(_) => None,
                },
                Coc::Fixed(_) => unreachable!("the rule has depth"),
            }
        };
        let [none, first, second, last] = [false, true, true, false].map(&mut refiner_after);
        assert_eq!((none, last), (None, None));
        assert!(first.is_some() && first == second, "what it has seen is kept");
    }
}

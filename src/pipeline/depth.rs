//! Second stage: gives each frame its depth and its CoC.

use std::time::Duration;

use super::capture::Shot;
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
}

pub(super) struct Stage<'a> {
    pub coc: CocRule,
    pub refine: bool,
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
            CocRule::Depth { focus, lens, max_coc_px } => {
                let maker = if refine { Maker::Refine(Box::new(Refiner::new())) } else { Maker::Fill(Filler::new()) };
                Self::Depth(Box::new(DepthCoc { focus: Focus::new(focus), maker, lens, max_coc_px }))
            }
        }
    }
}

impl DepthCoc {
    /// Focuses on what was measured, and only then makes up what was not.
    fn see(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> CocField {
        let focus_m = self.focus.focus_m(map, time_ns);
        match &mut self.maker {
            Maker::Fill(filler) => filler.fill_by(map, color),
            Maker::Refine(refiner) => refiner.refine(map, color, time_ns),
        }
        self.lens.field(focus_m, color.width, self.max_coc_px)
    }
}

impl Stage<'_> {
    pub(super) fn run(mut self, mut from: Receiver<Frame<Shot>>, mut to: Sender<Frame<Ready>>) -> Ended {
        let mut coc = Coc::new(self.coc, self.refine);
        let mut complained = false;
        loop {
            let Frame { ticket, stamp, item: Shot { mut color, depth, right } } = match from.recv_timeout(IDLE) {
                Received::Item(frame) => frame,
                Received::Ended => break,
                Received::Nothing => {
                    if let Some(source) = &mut self.source {
                        source.rest();
                    }
                    continue;
                }
            };
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
            if !hand_on(&mut to, Frame { ticket, stamp, item: Ready { color, depth, coc } }, self.tally) {
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

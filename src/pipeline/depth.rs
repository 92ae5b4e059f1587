//! Second stage: gives each frame its depth and its CoC.

use std::time::Duration;

use super::capture::Shot;
use super::{CocAtInfinity, CocRule, Ended, Fault, Frame, hand_on};
use crate::budget::{Governor, Sample};
use crate::clock::Clock;
use crate::depth::fill::Filler;
use crate::depth::focus::Focus;
use crate::depth::refine::Refiner;
use crate::depth::{DepthError, DepthSource};
use crate::frame::{ColorImage, DepthMap, Stamp};
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
    /// How often depth is made; `None` makes it for every frame.
    pub rate: Option<Rate>,
    pub times: &'a mut Histogram,
    pub held: &'a mut u64,
}

/// For how many frames one depth is made, where there is no time for each: the ladder of this stage.
pub(super) struct Rate {
    governor: Governor,
    budget_ns: u64,
    /// Frames since depth was made, that one included.
    age: usize,
    /// What was made last, where the next frame may be given it, too.
    last: Option<CocField>,
    map: DepthMap,
}

impl Rate {
    /// Frames that share a depth at each rung, and what that costs a frame beside a depth of its own.
    const FRAMES: [usize; 3] = [3, 2, 1];
    const COSTS: [f64; 3] = [1.0 / 3.0, 0.5, 1.0];

    /// Depth may take `budget_ns` of a frame's time, on average.
    pub(super) fn new(budget_ns: u64) -> Self {
        let governor = Governor::new(&Self::COSTS, Self::COSTS.len() - 1);
        Self { governor, budget_ns, age: 0, last: None, map: DepthMap::default() }
    }

    /// Whether the next frame is given the last depth; counts the frame.
    fn holds(&mut self) -> Option<CocField> {
        if self.age >= Self::FRAMES[self.governor.rung()] {
            self.last = None;
        }
        self.age += 1;
        self.last
    }

    /// Depth was made, and took so long.
    fn made(&mut self, (map, field): (&DepthMap, CocField), took_ns: u64, at_ns: u64) {
        self.age = 1;
        let rung = self.governor.rung();
        let took_ns = (took_ns as f64 * Self::COSTS[rung]) as u64;
        self.governor.note(Sample { rung, took_ns, at_ns }, self.budget_ns);
        // The first one, too: no later frame shall be the one that takes the memory.
        if Self::FRAMES[self.governor.rung()] > 1 || self.map.metres.is_empty() {
            copy(map, &mut self.map);
            self.last = Some(field);
        }
    }
}

fn copy(from: &DepthMap, to: &mut DepthMap) {
    to.resize(from.width, from.height);
    to.metres.copy_from_slice(&from.metres);
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
            let Frame { ticket, stamp, item: Shot { color, depth } } = match from.recv_timeout(IDLE) {
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
                Coc::Depth(coc) => self.see(coc, depth, &color, stamp).map(|(map, field)| (Some(map), field)),
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
        brought: Option<Pooled<DepthMap>>,
        color: &ColorImage,
        stamp: Stamp,
    ) -> Result<(Pooled<DepthMap>, CocField), Fault> {
        if let Some((field, rate)) = self.rate.as_mut().and_then(|rate| Some((rate.holds()?, rate))) {
            let mut map = brought.unwrap_or_else(|| self.depths.take());
            copy(&rate.map, &mut map);
            *self.held += 1;
            return Ok((map, field));
        }
        let began_ns = self.clock.now_ns();
        let mut map = brought.map_or_else(|| self.read(stamp), Ok)?;
        let field = coc.see(&mut map, color, stamp.time_ns);
        let now_ns = self.clock.now_ns();
        self.times.add(now_ns - began_ns);
        if let Some(rate) = &mut self.rate {
            rate.made((&map, field), now_ns - began_ns, now_ns);
        }
        Ok((map, field))
    }

    fn read(&mut self, stamp: Stamp) -> Result<Pooled<DepthMap>, Fault> {
        let Some(source) = &mut self.source else {
            return Err(Fault::NoDepth { source_name: self.source_name.to_owned() });
        };
        let mut map = self.depths.take();
        source.read(stamp, &mut map)?;
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which frames of 200 are given the depth of the one before, where making it takes so long.
    fn held(took_ns: u64) -> Vec<bool> {
        let mut rate = Rate::new(16_000_000);
        let map = DepthMap::new(2, 2);
        let frame = |now_ns| {
            if rate.holds().is_some() {
                return true;
            }
            rate.made((&map, CocField::Uniform { radius_px: 1.0 }), took_ns, now_ns);
            false
        };
        (1..=200).map(|frame| frame * 33_000_000).map(frame).collect()
    }

    #[test]
    fn depth_is_made_as_often_as_there_is_time() {
        for (took_ms, every) in [(10, 1), (20, 2), (40, 3), (400, 3)] {
            let held = held(took_ms * 1_000_000);
            assert!(!held[0], "the first frame has no other to take it from");
            let made: Vec<usize> = (20..200).filter(|&frame| !held[frame]).collect();
            assert!(made.windows(2).all(|pair| pair[1] - pair[0] == every), "{took_ms} ms: {made:?}");
        }
    }
}

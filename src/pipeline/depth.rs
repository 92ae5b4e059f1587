//! Second stage: gives each frame its depth and its CoC.

use super::capture::Shot;
use super::{CocAtInfinity, CocRule, Ended, Fault, Frame, hand_on};
use crate::clock::Clock;
use crate::depth::DepthSource;
use crate::depth::fill::Filler;
use crate::depth::focus::Focus;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::{Pool, Pooled};
use crate::link::{Receiver, Sender};
use crate::optics::CocField;
use crate::stats::{Cause, Histogram, Tally};

/// All that the blur needs of a frame.
pub(super) struct Ready {
    pub color: Pooled<ColorImage>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
}

pub(super) struct Stage<'a> {
    pub coc: Coc,
    pub source: Option<Box<dyn DepthSource>>,
    pub source_name: &'a str,
    pub keep_going: bool,
    pub depths: &'a Pool<DepthMap>,
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    pub times: &'a mut Histogram,
}

/// A [`CocRule`] at work.
pub(super) enum Coc {
    Fixed(CocField),
    Depth { focus: Focus, filler: Filler, lens: CocAtInfinity, max_coc_px: f32 },
}

impl Coc {
    pub(super) fn new(rule: CocRule) -> Self {
        match rule {
            CocRule::Fixed(field) => Self::Fixed(field),
            CocRule::Depth { focus, lens, max_coc_px } => {
                Self::Depth { focus: Focus::new(focus), filler: Filler::new(), lens, max_coc_px }
            }
        }
    }
}

impl Stage<'_> {
    pub(super) fn run(mut self, mut from: Receiver<Frame<Shot>>, mut to: Sender<Frame<Ready>>) -> Ended {
        let mut complained = false;
        while let Some(Frame { ticket, stamp, item: Shot { color, depth } }) = from.recv() {
            let (depth, coc) = match &mut self.coc {
                Coc::Fixed(field) => (None, *field),
                Coc::Depth { focus, filler, lens, max_coc_px } => {
                    let began_ns = self.clock.now_ns();
                    let mut map = match (depth, &mut self.source) {
                        (Some(exact), _) => exact,
                        (None, Some(source)) => {
                            let mut map = self.depths.take();
                            if let Err(error) = source.read(stamp.index, &mut map) {
                                self.tally.dropped(ticket, Cause::Corrupt);
                                if !self.keep_going {
                                    return Err(error.into());
                                }
                                if !complained {
                                    tracing::warn!("{error}; going on without such frames");
                                    complained = true;
                                }
                                continue;
                            }
                            map
                        }
                        (None, None) => {
                            self.tally.dropped(ticket, Cause::Failed);
                            return Err(Fault::NoDepth { source_name: self.source_name.to_owned() });
                        }
                    };
                    // Focused on what was measured, not on what was made up.
                    let focus_m = focus.focus_m(&map, stamp.time_ns);
                    filler.fill(&mut map);
                    self.times.add(self.clock.now_ns() - began_ns);
                    (Some(map), lens.field(focus_m, color.width, *max_coc_px))
                }
            };
            if !hand_on(&mut to, Frame { ticket, stamp, item: Ready { color, depth, coc } }, self.tally) {
                break;
            }
        }
        Ok(())
    }
}

//! A plate as a source of depth: taken with a countdown, then used.

use std::any::Any;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::{Capture, Plate, Taken};
use crate::depth::matting::mask::MaskMatting;
use crate::depth::{DepthError, DepthSource, Seen};
use crate::frame::{ColorImage, DepthMap, Mask};

/// So long a person has to step out of the picture.
const COUNTDOWN_NS: u64 = 3_000_000_000;
/// A camera that has just been started finds its exposure in this time.
const SETTLES_NS: u64 = 1_000_000_000;
/// What moves for longer than this before a plate could be taken is the camera, or will not stop.
const RESTLESS_NS: u64 = 10_000_000_000;

/// What holds exposure, white balance and focus of a camera where they are until it is dropped.
pub type Lock = Box<dyn FnOnce() -> Option<Box<dyn Any + Send>> + Send>;

/// What else looks at the pictures, and knows more of them than a plate tells.
pub trait Companion: DepthSource {
    /// Where persons are in the picture `seen`, which is the next one; `None` where that is not known.
    fn persons(&mut self, seen: Seen) -> Option<&Mask>;

    /// Gives `map` the distances of all that is behind what `mask` has, in the same picture.
    fn measure_behind(&mut self, color: &ColorImage, mask: &Mask, map: &mut DepthMap);
}

/// How far a plate is, for the person who waits for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// They have so many seconds to step out of the picture.
    StepOut(u32),
    /// It is being taken; so much of it is, in percent.
    Taking(u32),
    /// Something moves.
    Moves,
    /// Something has moved for so long that no plate can be taken.
    Restless,
    /// There is one.
    Ready,
    /// There is one, and the picture is another: the camera was moved, or the light is.
    Unlike,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StepOut(seconds) => write!(f, "step out of the picture: {seconds}"),
            Self::Taking(_) => f.write_str("stay out for a second: the plate is being taken"),
            Self::Moves => f.write_str("something moves: stay out of the picture"),
            Self::Restless => f.write_str(
                "something keeps moving, so that no plate can be taken: let the camera stand on something firm, and leave the \
                 picture",
            ),
            Self::Ready => f.write_str("the plate is taken: come back"),
            Self::Unlike => f.write_str(
                "the picture is not that of the plate, so all is blurred: the camera was moved or the light has changed; take \
                 another plate",
            ),
        }
    }
}

/// What those who wait for a plate share with it.
#[derive(Debug, Default)]
pub struct Guide {
    /// The kind of step, times [`KINDS`], plus its number.
    step: AtomicU32,
    again: AtomicBool,
}

const KINDS: u32 = 1 << 16;

impl Guide {
    /// The step now.
    pub fn step(&self) -> Step {
        let step = self.step.load(Ordering::Relaxed);
        let number = step % KINDS;
        match step / KINDS {
            0 => Step::StepOut(number),
            1 => Step::Taking(number),
            2 => Step::Moves,
            3 => Step::Restless,
            4 => Step::Ready,
            _ => Step::Unlike,
        }
    }

    /// Takes another plate.
    pub fn take_again(&self) {
        self.again.store(true, Ordering::Relaxed);
    }

    fn tell(&self, step: Step) {
        let (kind, number) = match step {
            Step::StepOut(seconds) => (0, seconds),
            Step::Taking(percent) => (1, percent),
            Step::Moves => (2, 0),
            Step::Restless => (3, 0),
            Step::Ready => (4, 0),
            Step::Unlike => (5, 0),
        };
        self.step.store(kind * KINDS + number, Ordering::Relaxed);
    }
}

#[derive(Debug)]
enum State {
    /// To be taken: since when, once there was a picture.
    Waiting(Option<u64>),
    Taking {
        capture: Box<Capture>,
        since_ns: u64,
    },
    Using(Box<Plate>),
}

/// Depth with a matte from a plate: who stands before it is in focus, all else is far, or as far as a companion says. While
/// there is none, everything is blurred, or what the companion makes of it is.
pub struct PlateDepth {
    state: State,
    guide: Arc<Guide>,
    lock: Option<Lock>,
    companion: Option<Box<dyn Companion>>,
    /// While this lives, the camera is as it was when the plate was taken.
    locked: Option<Box<dyn Any + Send>>,
    matting: MaskMatting,
    first_ns: Option<u64>,
}

impl PlateDepth {
    /// A plate that is there, or one that is to be taken from the first pictures.
    pub fn new(plate: Option<ColorImage>, lock: Option<Lock>, companion: Option<Box<dyn Companion>>) -> Self {
        let state = plate.map_or(State::Waiting(None), |plate| State::Using(Box::new(Plate::new(plate))));
        let guide = Arc::default();
        Self { state, guide, lock, companion, locked: None, matting: MaskMatting::default(), first_ns: None }
    }

    /// How far it is.
    pub fn guide(&self) -> Arc<Guide> {
        Arc::clone(&self.guide)
    }

    /// The plate, once there is one.
    pub fn plate(&self) -> Option<&ColorImage> {
        match &self.state {
            State::Using(plate) => Some(plate.color()),
            State::Waiting(_) | State::Taking { .. } => None,
        }
    }

    /// Goes on from a picture towards a plate, or compares it with the one there is; tells how far that is.
    fn look(&mut self, seen: Seen) -> Step {
        let Seen { stamp, color, .. } = seen;
        let now_ns = stamp.time_ns;
        if self.guide.again.swap(false, Ordering::Relaxed) {
            self.state = State::Waiting(None);
        }
        let first_ns = *self.first_ns.get_or_insert(now_ns);
        if now_ns >= first_ns + SETTLES_NS
            && let Some(lock) = self.lock.take()
        {
            self.locked = lock();
        }
        let persons = match self.state {
            State::Waiting(_) => None,
            _ => self.companion.as_mut().and_then(|companion| companion.persons(seen)),
        };
        match &mut self.state {
            State::Waiting(since_ns) => {
                let since_ns = *since_ns.get_or_insert(now_ns);
                let waited_ns = now_ns.saturating_sub(since_ns);
                if waited_ns < COUNTDOWN_NS {
                    return Step::StepOut((COUNTDOWN_NS - waited_ns).div_ceil(1_000_000_000) as u32);
                }
                self.state = State::Taking { capture: Box::default(), since_ns: now_ns };
                Step::Taking(0)
            }
            State::Taking { capture, since_ns } => match capture.add(color, now_ns, persons) {
                Taken::More(share) => Step::Taking((100.0 * share) as u32),
                Taken::Moved if now_ns > *since_ns + RESTLESS_NS => Step::Restless,
                Taken::Moved => Step::Moves,
                Taken::Whole(plate) => {
                    let mut plate = Box::new(Plate::new(plate));
                    plate.look(color, now_ns, persons);
                    self.state = State::Using(plate);
                    Step::Ready
                }
            },
            State::Using(plate) => match plate.size() == color.size() && plate.look(color, now_ns, persons) {
                true => Step::Ready,
                false => Step::Unlike,
            },
        }
    }
}

impl DepthSource for PlateDepth {
    fn read(&mut self, seen: Seen, map: &mut DepthMap) -> Result<(), DepthError> {
        let (step, color) = (self.look(seen), seen.color);
        self.guide.tell(step);
        // Until there is a plate, and where it is of no use, others know better than nobody.
        if let (Some(companion), true) = (&mut self.companion, step != Step::Ready) {
            return companion.read(seen, map);
        }
        map.resize(color.width, color.height);
        map.matte.pixels.clear();
        map.metres.fill(DepthMap::FAR_M);
        (map.subject_m, map.is_smooth) = (Some(DepthMap::SUBJECT_M), false);
        if let (State::Using(plate), Step::Ready) = (&self.state, step) {
            if let Some(companion) = &mut self.companion {
                companion.measure_behind(color, plate.mask(), map);
            }
            self.matting.find(plate.mask(), color, Some(&plate.backdrop()), map);
        }
        Ok(())
    }

    fn knows_background(&self) -> bool {
        true
    }

    fn efforts(&self) -> &'static [f64] {
        self.companion.as_ref().map_or(&[1.0], |companion| companion.efforts())
    }

    fn may_be_shared(&self) -> bool {
        false
    }

    fn set_effort(&mut self, effort: usize) {
        self.companion.iter_mut().for_each(|companion| companion.set_effort(effort));
    }

    fn jump(&mut self, ahead_ns: i64) {
        self.companion.iter_mut().for_each(|companion| companion.jump(ahead_ns));
    }
}

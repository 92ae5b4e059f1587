//! Depth source with a plate: captured after a countdown, then used.

use std::any::Any;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::{Capture, CaptureResult, Obstacle, Plate};
use crate::depth::matting::mask::MaskMatting;
use crate::depth::{DepthError, DepthSource, FrameInput};
use crate::frame::{ColorImage, DepthMap, Mask};

/// Time for a person to step out of the picture.
const COUNTDOWN_NS: u64 = 3_000_000_000;
/// Time in which a newly started camera settles its exposure.
const SETTLE_NS: u64 = 1_000_000_000;
/// Motion that prevents a capture for longer than this does not stop by itself.
const MAX_MOTION_NS: u64 = 10_000_000_000;

/// Locks the camera's exposure, white balance and focus, until the result is dropped.
pub type CameraLock = Box<dyn FnOnce() -> Option<Box<dyn Any + Send>> + Send>;

/// A second source that sees the same pictures and knows more than a plate.
pub trait Companion: DepthSource {
    /// Returns a mask of the persons in the picture `seen`, which is the next one; `None` if unknown.
    fn segment_persons(&mut self, seen: FrameInput) -> Option<&Mask>;

    /// Fills `map` with the distances behind the subject, which `mask` has, in the same picture.
    fn measure_background(&mut self, color: &ColorImage, mask: &Mask, map: &mut DepthMap);
}

/// Progress of the capture, shown to the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Seconds left to step out of the picture.
    StepOut(u32),
    /// The capture's progress in percent.
    Capturing(u32),
    /// Something moves.
    Moving,
    /// Something has moved for so long that no plate can be captured.
    KeepsMoving,
    /// A person seems to be there, at rest: [`Guide::ignore_persons`] captures the plate anyway.
    PersonThere,
    /// The plate is in use.
    Ready,
    /// The plate does not match the picture: the camera was moved or the light has changed.
    Mismatched,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StepOut(seconds) => write!(f, "step out of the picture: {seconds}"),
            Self::Capturing(_) => f.write_str("stay out for a second: the plate is being taken"),
            Self::Moving => f.write_str("something moves: stay out of the picture"),
            Self::KeepsMoving => f.write_str(
                "something keeps moving, so no plate can be taken: put the camera on something firm, and leave the \
                 picture",
            ),
            Self::PersonThere => f.write_str(
                "somebody seems to be there: leave the picture; if nobody is, take a plate with `bokehcam plate`, and give \
                 it with --depth plate:FILE.png",
            ),
            Self::Ready => f.write_str("the plate is taken: come back"),
            Self::Mismatched => f.write_str(
                "the picture no longer matches the plate, so everything is blurred: the camera was moved or the light \
                 has changed; take another plate",
            ),
        }
    }
}

/// State shared with the user interface.
#[derive(Debug, Default)]
pub struct Guide {
    /// Kind of the step times [`KINDS`], plus its number.
    step: AtomicU32,
    is_capture_requested: AtomicBool,
    /// Whether what looks like a person does not prevent the capture.
    are_persons_ignored: AtomicBool,
}

const KINDS: u32 = 1 << 16;

impl Guide {
    /// Returns the current step.
    pub fn step(&self) -> Step {
        let step = self.step.load(Ordering::Relaxed);
        let number = step % KINDS;
        match step / KINDS {
            0 => Step::StepOut(number),
            1 => Step::Capturing(number),
            2 => Step::Moving,
            3 => Step::KeepsMoving,
            4 => Step::PersonThere,
            5 => Step::Ready,
            _ => Step::Mismatched,
        }
    }

    /// Captures this plate although a person seems to be there.
    pub fn ignore_persons(&self) {
        self.are_persons_ignored.store(true, Ordering::Relaxed);
    }

    /// Requests the capture of a new plate.
    pub fn request_capture(&self) {
        self.are_persons_ignored.store(false, Ordering::Relaxed);
        self.is_capture_requested.store(true, Ordering::Relaxed);
    }

    fn set_step(&self, step: Step) {
        let (kind, number) = match step {
            Step::StepOut(seconds) => (0, seconds),
            Step::Capturing(percent) => (1, percent),
            Step::Moving => (2, 0),
            Step::KeepsMoving => (3, 0),
            Step::PersonThere => (4, 0),
            Step::Ready => (5, 0),
            Step::Mismatched => (6, 0),
        };
        self.step.store(kind * KINDS + number, Ordering::Relaxed);
    }
}

#[derive(Debug)]
enum State {
    /// Waits for the countdown; contains its start, once there was a picture.
    CountingDown(Option<u64>),
    Capturing {
        capture: Box<Capture>,
        since_ns: u64,
    },
    InUse(Box<Plate>),
}

/// Depth source from a plate: the foreground is in focus, and the rest is far, or as far as the companion measures.
/// Without a usable plate, everything is blurred, or the companion's depth is used.
pub struct PlateDepth {
    state: State,
    guide: Arc<Guide>,
    lock: Option<CameraLock>,
    companion: Option<Box<dyn Companion>>,
    /// Keeps the camera's settings locked as long as it lives.
    locked: Option<Box<dyn Any + Send>>,
    matting: MaskMatting,
    first_ns: Option<u64>,
}

impl PlateDepth {
    /// Creates a source from an existing plate, or one that captures it from the first pictures.
    pub fn new(plate: Option<ColorImage>, lock: Option<CameraLock>, companion: Option<Box<dyn Companion>>) -> Self {
        let state = plate.map_or(State::CountingDown(None), |plate| State::InUse(Box::new(Plate::new(plate))));
        let guide = Arc::default();
        Self { state, guide, lock, companion, locked: None, matting: MaskMatting::default(), first_ns: None }
    }

    /// Returns the shared state of the capture.
    pub fn guide(&self) -> Arc<Guide> {
        Arc::clone(&self.guide)
    }

    /// Returns the plate, once captured.
    pub fn plate(&self) -> Option<&ColorImage> {
        match &self.state {
            State::InUse(plate) => Some(plate.color()),
            State::CountingDown(_) | State::Capturing { .. } => None,
        }
    }

    /// Advances the capture by a picture, or compares it with the plate. Returns the new step.
    fn advance(&mut self, seen: FrameInput) -> Step {
        let FrameInput { stamp, color, .. } = seen;
        let now_ns = stamp.time_ns;
        if self.guide.is_capture_requested.swap(false, Ordering::Relaxed) {
            self.state = State::CountingDown(None);
        }
        let first_ns = *self.first_ns.get_or_insert(now_ns);
        if now_ns >= first_ns + SETTLE_NS
            && let Some(lock) = self.lock.take()
        {
            self.locked = lock();
        }
        let persons = match self.state {
            State::CountingDown(_) => None,
            State::Capturing { .. } if self.guide.are_persons_ignored.load(Ordering::Relaxed) => None,
            _ => self.companion.as_mut().and_then(|companion| companion.segment_persons(seen)),
        };
        match &mut self.state {
            State::CountingDown(since_ns) => {
                let since_ns = *since_ns.get_or_insert(now_ns);
                let waited_ns = now_ns.saturating_sub(since_ns);
                if waited_ns < COUNTDOWN_NS {
                    return Step::StepOut((COUNTDOWN_NS - waited_ns).div_ceil(1_000_000_000) as u32);
                }
                self.state = State::Capturing { capture: Box::default(), since_ns: now_ns };
                Step::Capturing(0)
            }
            State::Capturing { capture, since_ns } => match capture.add(color, now_ns, persons) {
                CaptureResult::Collecting(progress) => Step::Capturing((100.0 * progress) as u32),
                CaptureResult::Rejected(Obstacle::Person) => Step::PersonThere,
                CaptureResult::Rejected(_) if now_ns > *since_ns + MAX_MOTION_NS => Step::KeepsMoving,
                CaptureResult::Rejected(_) => Step::Moving,
                CaptureResult::Finished(plate) => {
                    let mut plate = Box::new(Plate::new(plate));
                    plate.update(color, now_ns, persons);
                    self.state = State::InUse(plate);
                    Step::Ready
                }
            },
            State::InUse(plate) => match plate.size() == color.size() && plate.update(color, now_ns, persons) {
                true => Step::Ready,
                false => Step::Mismatched,
            },
        }
    }
}

impl DepthSource for PlateDepth {
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        let (step, color) = (self.advance(seen), seen.color);
        self.guide.set_step(step);
        // Without a usable plate, the companion's depth is better than none.
        if let (Some(companion), true) = (&mut self.companion, step != Step::Ready) {
            return companion.read(seen, map);
        }
        map.fill_far(color.size());
        if let (State::InUse(plate), Step::Ready) = (&self.state, step) {
            if let Some(companion) = &mut self.companion {
                companion.measure_background(color, plate.mask(), map);
            }
            self.matting.compute_matte(plate.mask(), color, Some(&plate.as_background_plate()), map);
        }
        Ok(())
    }

    fn knows_background(&self) -> bool {
        true
    }

    fn efforts(&self) -> &'static [f64] {
        self.companion.as_ref().map_or(&[1.0], |companion| companion.efforts())
    }

    fn is_reusable(&self) -> bool {
        false
    }

    fn set_effort(&mut self, effort: usize) {
        self.companion.iter_mut().for_each(|companion| companion.set_effort(effort));
    }

    fn seek(&mut self, ahead_ns: i64) {
        self.companion.iter_mut().for_each(|companion| companion.seek(ahead_ns));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Stamp;

    /// Takes something at rest in every picture for a person.
    struct SeesSomebody(Mask);

    impl DepthSource for SeesSomebody {
        fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
            map.resize(seen.color.width, seen.color.height);
            Ok(())
        }
    }

    impl Companion for SeesSomebody {
        fn segment_persons(&mut self, _: FrameInput) -> Option<&Mask> {
            Some(&self.0)
        }
        fn measure_background(&mut self, _: &ColorImage, _: &Mask, _: &mut DepthMap) {}
    }

    #[test]
    fn what_looks_like_a_person_is_said_and_taken_only_by_who_knows_better() {
        let mut mask = Mask::default();
        mask.resize(64, 48);
        mask.alpha[..600].fill(1.0);
        let mut source = PlateDepth::new(None, None, Some(Box::new(SeesSomebody(mask))));
        let (guide, room) = (source.guide(), ColorImage::new(64, 48));
        let mut map = DepthMap::default();
        let mut time_ns = 0;
        let mut play = |seconds: u64, until: Step| {
            for _ in 0..10 * seconds {
                time_ns += 100_000_000;
                let stamp = Stamp { index: 0, time_ns, captured_ns: None };
                source.read(FrameInput { stamp, color: &room, right: None }, &mut map).unwrap();
                if guide.step() == until {
                    return true;
                }
            }
            false
        };
        assert!(play(4, Step::PersonThere));
        assert!(!play(20, Step::Ready) && guide.step() == Step::PersonThere, "however long it takes");
        guide.ignore_persons();
        assert!(play(3, Step::Ready));
        // That was said about one plate.
        guide.request_capture();
        assert!(play(4, Step::PersonThere) && !play(5, Step::Ready));
    }
}

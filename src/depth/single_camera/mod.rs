//! Depth and matte from one ordinary camera, by the user's own networks: a person mask (`matte`), relative depth
//! (`mono`), or both.
//!
//! The person is one surface, in focus by default. Objects as near as and connected to the person, such as held ones,
//! belong to it; persons further away do not. With a mask alone, everything else is infinitely far.

mod absence;
mod aside;
mod belongings;
mod decision;
mod feed;
mod held;
mod parts;
mod person;
mod relief;

use std::path::Path;

pub use feed::Hints;

use absence::Absence;
use feed::Feed;
use held::Held;
use person::Person;
use relief::Relief;

use super::matting::mask::MaskMatting;
use super::plate::Companion;
use super::tap::Tap;
use super::{DepthError, DepthSource, FrameInput};
use crate::compute::thread_pool::core_count;
use crate::frame::{ColorImage, DepthMap, Mask};
use crate::network::{self, Runtime, Task};

/// Interval in frames of the depth network beside persons, per effort level: a room hardly moves. The person network
/// runs in every frame, since outlines are valid for one frame only.
const EVERY: [u64; 3] = [8, 4, 2];
/// The interval without a person network.
const EVERY_ALONE: [u64; 3] = [2, 1, 1];
/// Relative cost of each effort level.
const EFFORTS: [f64; EVERY.len()] = [0.5, 0.8, 1.0];
/// Frames further apart in media time are unrelated.
const APART_NS: u64 = 500_000_000;

/// Depth from networks that run on a camera's pictures.
pub struct SingleCamera {
    name: String,
    runtime: String,
    person: Option<Person>,
    absence: Absence,
    relief: Option<Relief>,
    held: Held,
    spread: Spread,
    matting: MaskMatting,
    /// Index into [`EVERY`].
    effort: usize,
    /// Whether frames arrive in real time; if not, the results must not depend on this machine's speed.
    is_live: bool,
    frames: u64,
    last_ns: Option<u64>,
    turn: Turn,
    /// Whether a person network was loaded.
    has_subject: bool,
}

impl SingleCamera {
    /// Loads the networks in these files, at least one.
    ///
    /// # Errors
    /// A network cannot be loaded, or is for another task.
    pub fn open(
        matte: Option<&Path>,
        mono: Option<&Path>,
        hints: &Hints,
        runtime: Runtime,
    ) -> Result<Self, DepthError> {
        let (mut names, mut run_by) = (Vec::new(), String::new());
        let mut load = |path: &Path, task| {
            let name = path.display().to_string();
            let failed = |why: String| DepthError::Network { name: name.clone(), why };
            let loaded = network::load(path, runtime)?;
            if let Some(known) = loaded.known.filter(|known| known.task != task) {
                return Err(failed(format!("this is {}, a network for --depth {}", known.file, known.task.name())));
            }
            names.push(loaded.known.map_or_else(|| name.clone(), |known| known.file.to_owned()));
            run_by = loaded.network.runtime.clone();
            Feed::new(loaded, task, hints).map_err(failed)
        };
        let person = matte.map(|path| load(path, Task::Matte)).transpose()?.map(Person::new);
        let relief = mono.map(|path| load(path, Task::Mono)).transpose()?.map(Relief::new);
        let has_subject = person.is_some();
        let mut networks = Self {
            name: names.join(" and "),
            runtime: run_by,
            person,
            absence: Absence::default(),
            relief,
            held: Held::default(),
            spread: Spread::default(),
            matting: MaskMatting::default(),
            effort: EVERY.len() - 1,
            is_live: false,
            frames: 0,
            last_ns: None,
            turn: Turn::default(),
            has_subject,
        };
        networks.try_out()?;
        Ok(networks)
    }

    /// Returns a short description: the networks' names, and their runtime.
    pub fn describe(&self) -> String {
        format!("{}, run by {}", self.name, self.runtime)
    }

    /// Runs the networks on a grey picture, so that errors appear at the start.
    fn try_out(&mut self) -> Result<(), DepthError> {
        let Self { name, person, relief, .. } = self;
        let failed = |why| DepthError::Network { name: name.clone(), why };
        let mut grey = ColorImage::new(64, 48);
        grey.rgb.fill(128);
        person.as_mut().map_or(Ok(()), |person| person.run(&grey, 0)).map_err(failed)?;
        relief.as_mut().map_or(Ok(()), |relief| relief.run(&grey, None)).map_err(failed)
    }

    /// Starts a picture at `time_ns`: decides which networks run. Does nothing if the picture was started already.
    fn begin_picture(&mut self, time_ns: u64) {
        if self.last_ns == Some(time_ns) {
            return;
        }
        let apart = self.last_ns.is_none_or(|last_ns| time_ns.abs_diff(last_ns) > APART_NS);
        self.last_ns = Some(time_ns);
        if apart {
            self.person.iter_mut().for_each(Person::forget);
            self.held.forget();
        }
        // Without a person network, depth is also the source of the outlines.
        let every = if self.has_subject { EVERY } else { EVERY_ALONE }[self.effort];
        // Run depth in the background in real time, but not after a break, when the last result is of another scene.
        let in_background = self.is_live && self.has_subject && !apart && core_count() > 1;
        self.turn = Turn { persons: true, all: apart || self.frames.is_multiple_of(every), in_background };
        self.frames += 1;
    }

    /// Runs the person network if it is due; disables it on an error.
    fn run_person_network(&mut self, color: &ColorImage, time_ns: u64) {
        // At most one run per picture.
        let is_turn = std::mem::take(&mut self.turn.persons);
        if let Some(Err(why)) = self.person.as_mut().filter(|_| is_turn).map(|person| person.run(color, time_ns)) {
            tracing::error!("{}: the network for persons is turned off, so everything is blurred: {why}", self.name);
            self.person = None;
        }
    }
}

/// Runs the depth network around the subject in `mask` if it is due; disables it on an error.
fn run_depth(relief: &mut Option<Relief>, (name, turn): (&str, Turn), color: &ColorImage, mask: Option<&Mask>) {
    let looked = relief.as_mut().map(|relief| match turn {
        Turn { all: false, .. } => relief.collect(false),
        Turn { in_background: true, .. } => relief.run_async(color, mask),
        Turn { in_background: false, .. } => relief.run(color, mask),
    });
    if let Some(Err(why)) = looked {
        tracing::error!("{name}: the network for depth is turned off: {why}");
        *relief = None;
    }
}

/// The networks that are due for the current picture.
#[derive(Clone, Copy, Debug, Default)]
struct Turn {
    persons: bool,
    all: bool,
    /// Whether the depth result may arrive some frames later.
    in_background: bool,
}

impl DepthSource for SingleCamera {
    fn read(&mut self, FrameInput { stamp, color, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        self.begin_picture(stamp.time_ns);
        self.run_person_network(color, stamp.time_ns);
        let Self { name, person, absence, relief, held, spread, matting, turn, .. } = self;
        let mask = person.as_ref().map(Person::mask);
        if mask.is_some_and(|mask| absence.should_report(mask, stamp.time_ns)) {
            tracing::warn!(
                "{name}: no person was found for {} s, so everything is \
                            blurred",
                Absence::LONG_NS / 1_000_000_000
            );
        }
        run_depth(relief, (name, *turn), color, mask);
        if let (Some(mask), Some(relief)) = (mask, &relief) {
            held.complete(mask, relief);
        }
        map.resize(color.width, color.height);
        map.matte.pixels.clear();
        match &relief {
            Some(relief) if person.is_some() => spread.over(relief.behind(), relief.size(), map),
            Some(relief) if !self.has_subject => spread.over(relief.nearness(), relief.size(), map),
            _ => map.metres.fill(DepthMap::FAR_M),
        }
        // If the person network was disabled, the subject stays set, so that everything is blurred.
        map.subject_m = (self.has_subject || relief.is_none()).then_some(DepthMap::SUBJECT_M);
        map.is_smooth = map.subject_m.is_none();
        if let Some(person) = &person {
            let mask = if relief.is_some() { held.mask() } else { person.mask() };
            matting.compute_matte(mask, color, None, map);
        }
        Ok(())
    }

    fn efforts(&self) -> &'static [f64] {
        // Without a depth network, there is nothing to save.
        if self.relief.is_some() { &EFFORTS } else { &EFFORTS[EFFORTS.len() - 1..] }
    }

    fn is_reusable(&self) -> bool {
        !self.has_subject
    }

    fn set_effort(&mut self, effort: usize) {
        self.effort = effort.min(EVERY.len() - 1);
        // Effort is only reduced when time is short, so frames arrive in real time.
        self.is_live = true;
    }

    fn seek(&mut self, _: i64) {
        self.last_ns = None;
    }
}

impl Companion for SingleCamera {
    fn segment_persons(&mut self, FrameInput { stamp, color, .. }: FrameInput) -> Option<&Mask> {
        self.begin_picture(stamp.time_ns);
        self.run_person_network(color, stamp.time_ns);
        self.person.as_ref().map(Person::mask)
    }

    fn measure_background(&mut self, color: &ColorImage, mask: &Mask, map: &mut DepthMap) {
        run_depth(&mut self.relief, (&self.name, self.turn), color, Some(mask));
        if let Some(relief) = &self.relief {
            self.spread.over(relief.behind(), relief.size(), map);
        }
    }
}

/// Upsamples nearness to distances, bilinearly.
#[derive(Default)]
struct Spread {
    /// Per output column, the two source columns.
    columns: Vec<Tap>,
    row: Vec<f32>,
}

impl Spread {
    fn over(&mut self, nearness: &[f32], (width, height): (usize, usize), map: &mut DepthMap) {
        let (to_width, to_height) = (map.width as usize, map.height as usize);
        self.columns.clear();
        self.columns.extend((0..to_width).map(|x| Tap::new(x, to_width, width)));
        for (y, row) in map.metres.chunks_exact_mut(to_width.max(1)).enumerate() {
            let Tap { first, second, weight: down } = Tap::new(y, to_height, height);
            let (above, below) = (&nearness[first * width..][..width], &nearness[second * width..][..width]);
            self.row.clear();
            self.row.extend(above.iter().zip(below).map(|(a, b)| a + (b - a) * down));
            for (metres, tap) in row.iter_mut().zip(&self.columns) {
                let (left, right) = (self.row[tap.first], self.row[tap.second]);
                let nearness = left + (right - left) * tap.weight;
                *metres = DepthMap::relative_to_metres(nearness);
            }
        }
    }
}

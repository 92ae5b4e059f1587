//! Depth and matte from one ordinary camera, by the user's own networks: a person mask (`matte`), relative depth
//! (`mono`), or both.
//!
//! The person is one surface, in focus by default. Objects as near as and connected to the person, such as held ones,
//! belong to it; persons further away do not. With a mask alone, everything else is infinitely far.

mod absence;
mod background_worker;
mod components;
mod held_objects;
mod mask_postprocess;
mod person;
mod picture_network;
mod relative_depth;
mod shrink;
mod stillness;
mod subject_mask;

use std::path::Path;

pub use picture_network::Hints;

use absence::Absence;
use person::PersonSegmenter;
use picture_network::PictureNetwork;
use relative_depth::RelativeDepth;
use subject_mask::SubjectMask;

use crate::network::{self, NetworkError, Task};
use bokehcam::compute::thread_pool::core_count;
use bokehcam::depth::matting::mask::MaskMatting;
use bokehcam::depth::plate::Companion;
use bokehcam::depth::tap::Tap;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Mask};

/// Interval in frames of the depth network beside persons, per effort level: a room hardly moves. The person network
/// runs in every frame, since outlines are valid for one frame only.
const DEPTH_INTERVALS: [u64; 3] = [8, 4, 2];
/// The interval without a person network.
const DEPTH_INTERVALS_ALONE: [u64; 3] = [2, 1, 1];
/// Relative cost of each effort level.
const EFFORTS: [f64; DEPTH_INTERVALS.len()] = [0.5, 0.8, 1.0];
/// Frames further apart in media time are unrelated.
const MAX_GAP_NS: u64 = 500_000_000;

impl From<NetworkError> for DepthError {
    fn from(error: NetworkError) -> Self {
        Self::File(error.into())
    }
}

/// Depth from networks that run on a camera's pictures.
pub struct SingleCamera {
    name: String,
    runtime: &'static str,
    person: Option<PersonSegmenter>,
    absence: Absence,
    relative_depth: Option<RelativeDepth>,
    subject_mask: SubjectMask,
    upsampler: NearnessUpsampler,
    matting: MaskMatting,
    /// The map of the first of several still pictures, for the others, and whether there is one.
    held: (DepthMap, bool),
    /// Index into [`DEPTH_INTERVALS`].
    effort: usize,
    /// Whether frames arrive in real time; if not, the results must not depend on this machine's speed.
    is_live: bool,
    frames: u64,
    last_ns: Option<u64>,
    due: DueNetworks,
    /// Whether a person network was loaded.
    has_subject: bool,
}

impl SingleCamera {
    /// Loads the networks in these files, at least one.
    ///
    /// # Errors
    /// A network cannot be loaded, or is for another task.
    pub fn open(matte: Option<&Path>, mono: Option<&Path>, hints: &Hints) -> Result<Self, DepthError> {
        let (mut names, mut runtime, mut are_known) = (Vec::new(), "", true);
        let mut load = |path: &Path, task| {
            let name = path.display().to_string();
            let failed = |why: String| DepthError::Network { name: name.clone(), why };
            let loaded = network::load(path)?;
            if let Some(known) = loaded.known.filter(|known| known.task != task) {
                return Err(failed(format!("this is {}, a network for --depth {}", known.file, known.task.name())));
            }
            names.push(loaded.known.map_or_else(|| name.clone(), |known| known.file.to_owned()));
            (runtime, are_known) = (loaded.network.runtime, are_known && loaded.known.is_some());
            PictureNetwork::new(loaded, task, hints).map_err(failed)
        };
        let person = matte.map(|path| load(path, Task::Matte)).transpose()?.map(PersonSegmenter::new);
        let relative_depth = mono.map(|path| load(path, Task::Mono)).transpose()?.map(RelativeDepth::new);
        let has_subject = person.is_some();
        let mut networks = Self {
            name: names.join(" and "),
            runtime,
            person,
            absence: Absence::default(),
            relative_depth,
            subject_mask: SubjectMask::default(),
            upsampler: NearnessUpsampler::default(),
            matting: MaskMatting::default(),
            held: (DepthMap::default(), false),
            effort: DEPTH_INTERVALS.len() - 1,
            is_live: false,
            frames: 0,
            last_ns: None,
            due: DueNetworks::default(),
            has_subject,
        };
        if !are_known {
            networks.self_test()?;
        }
        Ok(networks)
    }

    /// Returns a short description: the networks' names, and their runtime.
    pub fn describe(&self) -> String {
        format!("{}, run by {}", self.name, self.runtime)
    }

    /// Runs the networks on a grey picture, so that the errors of unknown ones appear at the start.
    fn self_test(&mut self) -> Result<(), DepthError> {
        let Self { name, person, relative_depth, .. } = self;
        let failed = |why| DepthError::Network { name: name.clone(), why };
        let mut grey = ColorImage::new(64, 48);
        grey.rgb.fill(128);
        person.as_mut().map_or(Ok(()), |person| person.run(&grey, 0, false)).map_err(failed)?;
        relative_depth.as_mut().map_or(Ok(()), |relative_depth| relative_depth.run(&grey, None)).map_err(failed)
    }

    /// Starts a picture at `time_ns`: decides which networks run. Does nothing if the picture was started already.
    fn schedule_networks(&mut self, time_ns: u64) {
        if self.last_ns == Some(time_ns) {
            return;
        }
        let is_new_scene = self.last_ns.is_none_or(|last_ns| time_ns.abs_diff(last_ns) > MAX_GAP_NS);
        self.last_ns = Some(time_ns);
        if is_new_scene {
            self.person.iter_mut().for_each(PersonSegmenter::reset);
            self.subject_mask.reset();
        }
        // Without a person network, depth is also the source of the outlines.
        let every = if self.has_subject { DEPTH_INTERVALS } else { DEPTH_INTERVALS_ALONE }[self.effort];
        // Run depth in the background in real time, but not after a break, when the last result is of another scene.
        let in_background = self.is_live && self.has_subject && !is_new_scene && core_count() > 1;
        self.due =
            DueNetworks { person: true, depth: is_new_scene || self.frames.is_multiple_of(every), in_background };
        self.frames += 1;
    }

    /// Runs the person network if it is due; disables it on an error.
    fn run_person_network(&mut self, color: &ColorImage, time_ns: u64) {
        // At most one run per picture.
        let (is_due, is_live) = (std::mem::take(&mut self.due.person), self.is_live);
        let person = self.person.as_mut().filter(|_| is_due);
        if let Some(Err(why)) = person.map(|person| person.run(color, time_ns, is_live)) {
            tracing::error!("{}: the network for persons is turned off, so everything is blurred: {why}", self.name);
            self.person = None;
        }
    }
}

/// Runs the depth network around the subject in `mask` if it is due; disables it on an error.
fn run_depth_network(
    relative_depth: &mut Option<RelativeDepth>,
    name: &str,
    due: DueNetworks,
    color: &ColorImage,
    mask: Option<&Mask>,
) {
    let outcome = relative_depth.as_mut().map(|relative_depth| match due {
        DueNetworks { depth: false, .. } => relative_depth.collect(false),
        DueNetworks { in_background: true, .. } => relative_depth.submit(color, mask),
        DueNetworks { in_background: false, .. } => relative_depth.run(color, mask),
    });
    if let Some(Err(why)) = outcome {
        tracing::error!("{name}: the network for depth is turned off: {why}");
        *relative_depth = None;
    }
}

/// The networks that are due for the current picture.
#[derive(Clone, Copy, Debug, Default)]
struct DueNetworks {
    person: bool,
    depth: bool,
    /// Whether the depth result may arrive some frames later.
    in_background: bool,
}

impl DepthSource for SingleCamera {
    fn read(&mut self, FrameInput { stamp, color, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        self.schedule_networks(stamp.time_ns);
        self.run_person_network(color, stamp.time_ns);
        let Self { name, person, absence, relative_depth, subject_mask, upsampler, matting, held, due, .. } = self;
        let mask = person.as_ref().map(PersonSegmenter::mask);
        if mask.is_some_and(|mask| absence.should_report(mask, stamp.time_ns)) {
            tracing::warn!(
                "{name}: no person was found for {} s, so everything is blurred",
                Absence::MIN_REPORTED_NS / 1_000_000_000
            );
        }
        // Only the mask and the picture decide, so that the map of a still picture serves for the next.
        let is_still = relative_depth.is_none() && person.as_ref().is_some_and(PersonSegmenter::is_still);
        let (held, is_held) = held;
        if std::mem::replace(is_held, is_still) && is_still && held.size() == color.size() {
            map.copy_from(held);
            return Ok(());
        }
        run_depth_network(relative_depth, name, *due, color, mask);
        if let (Some(mask), Some(relative_depth)) = (mask, &relative_depth) {
            subject_mask.complete_mask(mask, relative_depth);
        }
        map.resize(color.width, color.height);
        map.matte.pixels.clear();
        match &relative_depth {
            Some(relative_depth) if person.is_some() => {
                upsampler.upsample(relative_depth.background(), relative_depth.size(), map)
            }
            Some(relative_depth) if !self.has_subject => {
                upsampler.upsample(relative_depth.nearness(), relative_depth.size(), map)
            }
            _ => map.metres.fill(DepthMap::FAR_M),
        }
        // If the person network was disabled, the subject stays set, so that everything is blurred.
        map.subject_m = (self.has_subject || relative_depth.is_none()).then_some(DepthMap::SUBJECT_M);
        map.is_smooth = map.subject_m.is_none();
        if let Some(person) = &person {
            let mask = if relative_depth.is_some() { subject_mask.mask() } else { person.mask() };
            matting.compute_matte(mask, color, None, map);
        }
        if is_still {
            held.copy_from(map);
        }
        Ok(())
    }

    fn efforts(&self) -> &'static [f64] {
        // Without a depth network, there is nothing to save.
        if self.relative_depth.is_some() { &EFFORTS } else { &EFFORTS[EFFORTS.len() - 1..] }
    }

    fn is_reusable(&self) -> bool {
        !self.has_subject
    }

    fn set_effort(&mut self, effort: usize) {
        self.effort = effort.min(DEPTH_INTERVALS.len() - 1);
        // Effort is only reduced when time is short, so frames arrive in real time.
        self.is_live = true;
    }

    fn seek(&mut self, _: i64) {
        self.last_ns = None;
    }
}

impl Companion for SingleCamera {
    fn segment_persons(&mut self, FrameInput { stamp, color, .. }: FrameInput) -> Option<&Mask> {
        self.schedule_networks(stamp.time_ns);
        self.run_person_network(color, stamp.time_ns);
        self.person.as_ref().map(PersonSegmenter::mask)
    }

    fn measure_background(&mut self, color: &ColorImage, mask: &Mask, map: &mut DepthMap) {
        run_depth_network(&mut self.relative_depth, &self.name, self.due, color, Some(mask));
        if let Some(relative_depth) = &self.relative_depth {
            self.upsampler.upsample(relative_depth.background(), relative_depth.size(), map);
        }
    }
}

/// Upsamples nearness to distances, bilinearly.
#[derive(Default)]
struct NearnessUpsampler {
    /// Per output column, the two source columns.
    columns: Vec<Tap>,
    row: Vec<f32>,
}

impl NearnessUpsampler {
    fn upsample(&mut self, nearness: &[f32], (width, height): (usize, usize), map: &mut DepthMap) {
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

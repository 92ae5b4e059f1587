//! Depth with a matte from one ordinary camera, by networks of the user's own: where a person is (`matte`), how near all
//! is (`mono`), or both.
//!
//! A person is one surface, in focus by default. What is as near and joined to them, as what they hold, is theirs; other
//! people, further away, are not. With a mask alone, all else is infinitely far.

mod feed;
mod held;
mod person;
mod relief;

use std::path::Path;

pub use feed::Hints;

use feed::Feed;
use held::Held;
use person::Person;
use relief::Relief;

use super::matting::mask::MaskMatting;
use super::{DepthError, DepthSource, Seen};
use crate::frame::{DepthMap, Mask};
use crate::network::{self, Runtime, Task};

/// Distance that a subject is given, in metres: only ratios of distances matter.
const SUBJECT_M: f32 = 1.0;
/// Nothing is nearer to 0, so that distances are numbers: what is as good as infinitely far.
const LEAST_NEARNESS: f32 = 1e-3;
/// Between two frames further apart than this, the first is no guide to the second.
const APART_NS: u64 = 500_000_000;

/// Networks at work on the pictures of a camera.
pub struct SingleCamera {
    name: String,
    person: Option<Person>,
    relief: Option<Relief>,
    held: Held,
    matting: MaskMatting,
    /// With less effort, networks look at every second picture.
    looks_at_all: bool,
    frames: u64,
    last_ns: Option<u64>,
}

impl SingleCamera {
    /// Loads the networks in these files, of which there is one at least.
    ///
    /// # Errors
    /// One cannot be loaded, or is none for its task.
    pub fn open(matte: Option<&Path>, mono: Option<&Path>, hints: &Hints, runtime: Runtime) -> Result<Self, DepthError> {
        let load = |path: &Path, task| {
            let name = path.display().to_string();
            let failed = |why: String| DepthError::Network { name: name.clone(), why };
            let loaded = network::load(path, runtime)?;
            if let Some(known) = loaded.known.filter(|known| known.task != task) {
                return Err(failed(format!("this is {}, a network for --depth {}", known.name, known.task.name())));
            }
            let feed = Feed::new(loaded, task, hints).map_err(failed)?;
            tracing::info!("{name}: run by {}", feed.runtime());
            Ok(feed)
        };
        let person = matte.map(|path| load(path, Task::Matte)).transpose()?.map(Person::new);
        let relief = mono.map(|path| load(path, Task::Mono)).transpose()?.map(Relief::new);
        let names = [matte, mono].into_iter().flatten().map(|path| path.display().to_string());
        Ok(Self {
            name: names.collect::<Vec<_>>().join(", "),
            person,
            relief,
            held: Held::default(),
            matting: MaskMatting::default(),
            looks_at_all: true,
            frames: 0,
            last_ns: None,
        })
    }
}

impl DepthSource for SingleCamera {
    fn read(&mut self, Seen { stamp, color, .. }: Seen, map: &mut DepthMap) -> Result<(), DepthError> {
        let Self { name, person, relief, held, matting, .. } = self;
        let failed = |why| DepthError::Network { name: name.clone(), why };
        let apart = self.last_ns.is_none_or(|last_ns| stamp.time_ns.abs_diff(last_ns) > APART_NS);
        self.last_ns = Some(stamp.time_ns);
        if apart {
            person.iter_mut().for_each(Person::forget);
        }
        let looks = apart || self.looks_at_all || self.frames.is_multiple_of(2);
        self.frames += 1;
        if looks {
            if let Some(person) = person {
                person.look(color).map_err(failed)?;
            }
            let mask = person.as_ref().map(Person::mask);
            if let Some(relief) = relief {
                relief.look(color, mask).map_err(failed)?;
            }
            if let (Some(mask), Some(relief)) = (mask, &relief) {
                held.join(mask, relief);
            }
        }
        map.resize(color.width, color.height);
        map.matte.pixels.clear();
        match &relief {
            Some(relief) => {
                let plane = if person.is_some() { relief.behind() } else { relief.nearness() };
                spread_over(plane, relief.size(), map);
            }
            None => map.metres.fill(SUBJECT_M / LEAST_NEARNESS),
        }
        map.subject_m = person.is_some().then_some(SUBJECT_M);
        if let Some(person) = &person {
            let mask: &Mask = if relief.is_some() { held.mask() } else { person.mask() };
            matting.find(mask, color, SUBJECT_M, map);
        }
        Ok(())
    }

    fn efforts(&self) -> &'static [f64] {
        &[0.6, 1.0]
    }

    fn set_effort(&mut self, effort: usize) {
        self.looks_at_all = effort > 0;
    }
}

/// Distances of a picture from nearness in fewer pixels, linear between them.
fn spread_over(nearness: &[f32], (width, height): (usize, usize), map: &mut DepthMap) {
    let (to_width, to_height) = (map.width as usize, map.height as usize);
    let place = |at: usize, to: usize, from: usize| {
        let place = ((at as f32 + 0.5) * from as f32 / to as f32 - 0.5).clamp(0.0, (from - 1) as f32);
        (place as usize, (place as usize + 1).min(from - 1), place.fract())
    };
    for (y, row) in map.metres.chunks_exact_mut(to_width.max(1)).enumerate() {
        let (above, below, down) = place(y, to_height, height);
        let (above, below) = (&nearness[above * width..][..width], &nearness[below * width..][..width]);
        for (x, metres) in row.iter_mut().enumerate() {
            let (left, right, along) = place(x, to_width, width);
            let upper = above[left] + (above[right] - above[left]) * along;
            let lower = below[left] + (below[right] - below[left]) * along;
            *metres = SUBJECT_M / (upper + (lower - upper) * down).max(LEAST_NEARNESS);
        }
    }
}

//! A stream, as others control it.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::controlled::{Standing, changed, refused};
use crate::error::CliError;
use crate::files::make_folder_of;
use crate::log;
use crate::settings::{changes, unused};
use bokehcam::budget::Quality;
use bokehcam::clock::Clock;
use bokehcam::computing::Executors;
#[cfg(feature = "desktop")]
use bokehcam::control::bus;
use bokehcam::control::{Answer, Claim, Handler, Name, Request, Server, Status};
use bokehcam::files::user_folders::Folders;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Look, Patch};
use bokehcam::pipeline::{Changes, Progress};
use bokehcam::recording::still;
use bokehcam::sink::Release;
use bokehcam::source::DepthChoice;
use bokehcam::stats::Pulse;

/// How long a picture that is to be saved is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// What is known of a run from its start.
pub(super) struct Facts {
    /// Its status; what changes is filled in when somebody asks.
    pub status: Status,
    /// Columns and rows of its pictures.
    pub size: (u32, u32),
    pub depth_choice: DepthChoice,
    /// Whether its frames have depth.
    pub has_depth: bool,
    /// What the warnings about settings to no effect go by.
    pub unused: unused::Run,
    /// The settings file, where one was chosen.
    pub config: Option<PathBuf>,
    /// Whether somebody watches, where that is noticed.
    pub demand: Option<Demand>,
    /// Keeps pictures away, and takes one.
    pub release: Release,
    pub beat: Arc<Beat>,
}

/// The look at the start, and how it is changed.
pub(super) struct Looks {
    pub look: Look,
    pub adaptive: bool,
    pub changes: Changes,
    pub executors: Executors,
}

/// A stream that answers until this is dropped.
pub(super) struct Served {
    /// Gone first: others on the bus ask no more.
    #[cfg(feature = "desktop")]
    bus: Option<bus::Bus>,
    server: Option<Server>,
    /// Makes executors, which takes longer than anybody should wait for an answer.
    looks: Option<JoinHandle<()>>,
}

impl Drop for Served {
    fn drop(&mut self) {
        #[cfg(feature = "desktop")]
        drop(self.bus.take());
        // With it goes the sender that the thread waits for.
        drop(self.server.take());
        // A panic was printed.
        let _ = self.looks.take().map(JoinHandle::join);
    }
}

/// What answers.
struct Controlled {
    facts: Facts,
    began: Instant,
    adaptive: bool,
    /// The look that was asked for last. Locked by those who ask and by who makes executors, never on a frame's way.
    look: Arc<Mutex<Look>>,
    /// Where it goes to be adopted.
    adopt: Sender<Look>,
}

/// What a frame leaves behind for those who ask.
pub(super) struct Beat {
    clock: Clock,
    pulse: Pulse,
    /// The rung of the last frame, counted from 1; 0 where it was not blurred.
    rung: AtomicU8,
}

impl Default for Beat {
    fn default() -> Self {
        Self { clock: Clock::system(), pulse: Pulse::default(), rung: AtomicU8::new(0) }
    }
}

impl Beat {
    /// Takes note of a frame that was delivered.
    pub fn note(&self, progress: &Progress) {
        self.pulse.beat(self.clock.now_ns());
        let rung = progress.quality.and_then(|quality| Quality::ALL.iter().position(|other| *other == quality));
        self.rung.store(rung.map_or(0, |rung| rung as u8 + 1), Ordering::Relaxed);
    }

    fn quality(&self) -> Option<Quality> {
        let rung = usize::from(self.rung.load(Ordering::Relaxed)).checked_sub(1)?;
        Quality::ALL.get(rung).copied()
    }
}

/// Answers those who ask from now on; `facts` are of the name that the stream has. With names of presets to show, it is on
/// the session's message bus as well, and in the tray.
///
/// # Errors
/// The system gives no thread.
pub(super) fn serve(
    claim: Claim,
    facts: impl FnOnce(&Name) -> Facts,
    looks: Looks,
    tray: Option<Vec<String>>,
) -> Result<Served, CliError> {
    let no_thread = |error| CliError::io("a thread that answers `bokehcam ctl`".as_ref())(error);
    let (facts, adaptive, look) = (facts(claim.name()), looks.adaptive, Arc::new(Mutex::new(looks.look.clone())));
    let (adopt, asked) = mpsc::channel();
    let (size, stated) = (facts.size, Arc::clone(&look));
    let follow = move || follow(looks, size, &asked, &stated);
    let looks = thread::Builder::new().name("looks".into()).spawn(follow).map_err(no_thread)?;
    let controlled = Controlled { facts, began: Instant::now(), adaptive, look, adopt };
    let handler: Arc<Handler> = Arc::new(move |request| controlled.answer(request));
    #[cfg(feature = "desktop")]
    let (bus, handler) = match tray.map(|presets| bus::serve(Arc::clone(&handler), presets)) {
        Some(Ok((bus, handler))) => (Some(bus), handler),
        Some(Err(why)) => {
            tracing::warn!("--tray: {why}");
            (None, handler)
        }
        None => (None, handler),
    };
    #[cfg(not(feature = "desktop"))]
    if tray.is_some() {
        tracing::warn!("--tray: this program was built without it; build it with the feature desktop");
    }
    let server = claim.serve(handler).map_err(no_thread)?;
    Ok(Served {
        #[cfg(feature = "desktop")]
        bus,
        server: Some(server),
        looks: Some(looks),
    })
}

/// Adopts the looks that are asked for, until nobody can any more.
fn follow(looks: Looks, size: (u32, u32), asked: &Receiver<Look>, stated: &Mutex<Look>) {
    let Looks { look: mut holds, mut changes, mut executors, .. } = looks;
    let mut number = 0;
    while let Ok(look) = asked.recv() {
        // Of several that wait only the last counts.
        let look = asked.try_iter().last().unwrap_or(look);
        number += 1;
        match changes.adopt(look.clone(), number, |settings| executors.blur(settings, size)) {
            Ok(()) => holds = look,
            Err(error) => {
                log::error(&format!("the look stays as it was: {error}"));
                let mut stated = lock(stated);
                // Not where another was asked for meanwhile.
                if *stated == look {
                    stated.clone_from(&holds);
                }
            }
        }
    }
}

fn lock(look: &Mutex<Look>) -> MutexGuard<'_, Look> {
    look.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Controlled {
    /// Does what is asked for.
    fn answer(&self, request: Request) -> Answer {
        let release = &self.facts.release;
        let done = match request {
            Request::Status => Ok(None),
            Request::On | Request::Off | Request::Toggle => {
                let closes = match request {
                    Request::Toggle => !release.is_closed(),
                    request => request == Request::Off,
                };
                release.close(closes);
                if closes {
                    release.wait_covered().map_err(|error| CliError::Control(error.to_string()))
                } else {
                    Ok(None)
                }
            }
            Request::Preset { name } => {
                changes::preset(self.facts.config.as_deref(), &name).and_then(|patch| self.change(&patch))
            }
            Request::Set { settings } => changes::patch(&settings).and_then(|patch| self.change(&patch)),
            Request::Depth { from } => Err(CliError::Usage(format!(
                "a stream keeps the depth that it began with: begin it anew with --depth {from}, or use a preview"
            ))),
            Request::Snapshot { to } => return self.save(to).unwrap_or_else(|error| refused(&error)),
        };
        match done {
            Ok(note) => Answer::Done { status: Box::new(self.status()), note },
            Err(error) => refused(&error),
        }
    }

    /// Changes the look; gives back what of that has no effect.
    fn change(&self, patch: &Patch) -> Result<Option<String>, CliError> {
        let &Facts { has_depth, ref depth_choice, size, unused, .. } = &self.facts;
        let mut stated = lock(&self.look);
        let run = Standing { size, depth_choice, has_depth, adaptive: self.adaptive, unused };
        let (look, note) = changed(patch, &stated, &run)?;
        if look != *stated {
            // Nobody takes it where the stream has just ended.
            let _ = self.adopt.send(look.clone());
            *stated = look;
        }
        Ok(note)
    }

    /// Saves the next picture.
    fn save(&self, to: Option<PathBuf>) -> Result<Answer, CliError> {
        let Facts { release, demand, .. } = &self.facts;
        let path = to.unwrap_or_else(|| Folders::of_user().free_picture());
        if !path.is_absolute() {
            return Err(CliError::Usage(format!("{}: say the whole path", path.display())));
        }
        if release.is_closed() {
            return Ok(Answer::failed("it is off: there is no picture"));
        }
        if demand.as_ref().is_some_and(|demand| !demand.is_watched()) {
            return Ok(Answer::failed("nobody watches, so the camera is closed: there is no picture"));
        }
        let Some(picture) = release.picture(PATIENCE) else {
            return Ok(Answer::failed(format!("no picture came for {} s", PATIENCE.as_secs())));
        };
        make_folder_of(&path)?;
        still::write_color(&path, &picture, false)?;
        Ok(Answer::Saved { saved: path })
    }

    fn status(&self) -> Status {
        let Facts { status, demand, release, beat, .. } = &self.facts;
        let look = lock(&self.look).clone();
        let round = |value: f64| (value * 10.0).round() / 10.0;
        Status {
            on: !release.is_closed(),
            watched: demand.as_ref().map(Demand::has_watchers),
            quality: beat.quality().map(|quality| quality.name().to_owned()),
            fps: round(beat.pulse.per_second(beat.clock.now_ns())),
            look: Patch::described(&look),
            uptime_s: round(self.began.elapsed().as_secs_f64()),
            ..status.clone()
        }
    }
}

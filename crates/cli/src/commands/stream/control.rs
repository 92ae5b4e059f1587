//! A stream, as others control it.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::controlled::{AsCommandLine, refused};
use crate::error::CliError;
use crate::files::make_folder_of;
use crate::log;
use bokehcam::budget::Quality;
use bokehcam::clock::Clock;
use bokehcam::computing::Executors;
#[cfg(feature = "desktop")]
use bokehcam::control::bus;
use bokehcam::control::{Answer, Claim, Server, Status};
use bokehcam::controller::{Controlled, Controller, Facts, Rules};
use bokehcam::files::user_folders::Folders;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Look, Patch};
use bokehcam::pipeline::{Changes, Progress};
use bokehcam::recording::still;
use bokehcam::sink::Release;
use bokehcam::stats::Pulse;

/// How long a picture that is to be saved is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// The look at the start, and how it is changed.
pub(super) struct Looks {
    pub look: Look,
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

/// A stream as those see it who control it.
pub(super) struct Running {
    /// What does not change.
    pub status: Status,
    pub facts: Facts,
    /// Whether somebody watches, where that is noticed.
    pub demand: Option<Demand>,
    /// Keeps pictures away, and takes one.
    pub release: Release,
    pub beat: Arc<Beat>,
}

/// A stream and its look.
struct Stream {
    run: Running,
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

/// Answers those who ask from now on, as the rules say. With names of presets to show, it is on the session's message bus as
/// well, and in the tray.
///
/// # Errors
/// The system gives no thread.
pub(super) fn serve(
    claim: Claim,
    run: Running,
    looks: Looks,
    rules: AsCommandLine,
    tray: Option<Vec<String>>,
) -> Result<Served, CliError> {
    let no_thread = |error| CliError::io("a thread that answers `bokehcam ctl`".as_ref())(error);
    let look = Arc::new(Mutex::new(looks.look.clone()));
    let (adopt, asked) = mpsc::channel();
    let (size, stated) = (run.facts.size, Arc::clone(&look));
    let follow = move || follow(looks, size, &asked, &stated);
    let looks = thread::Builder::new().name("looks".into()).spawn(follow).map_err(no_thread)?;
    let handler = Controller::begin(claim.name().clone(), "stream", Arc::new(rules), Stream { run, look, adopt });
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

impl Controlled for Stream {
    fn status(&self) -> Result<Status, Answer> {
        let Running { status, demand, release, beat, .. } = &self.run;
        Ok(Status {
            on: !release.is_closed(),
            watched: demand.as_ref().map(Demand::has_watchers),
            quality: beat.quality().map(|quality| quality.name().to_owned()),
            fps: beat.pulse.per_second(beat.clock.now_ns()),
            look: Patch::described(&lock(&self.look)),
            ..status.clone()
        })
    }

    fn switch(&self, on: Option<bool>) -> Result<bool, Answer> {
        let release = &self.run.release;
        let on = on.unwrap_or_else(|| release.is_closed());
        release.close(!on);
        Ok(on)
    }

    fn release(&self) -> Option<Release> {
        Some(self.run.release.clone())
    }

    fn change(&self, patch: Patch, rules: &Arc<dyn Rules>) -> Result<Option<String>, Answer> {
        let mut stated = lock(&self.look);
        let (look, note) = rules.changed(&patch, &stated, &self.run.facts)?;
        if look != *stated {
            // Nobody takes it where the stream has just ended.
            let _ = self.adopt.send(look.clone());
            *stated = look;
        }
        Ok(note)
    }

    fn make_depth_by(&self, way: &str) -> Result<(), Answer> {
        Err(Answer::usage(format!(
            "a stream keeps the depth that it began with: begin it anew with --depth {way}, or use a preview"
        )))
    }

    fn save(&self, to: Option<&Path>) -> Result<PathBuf, Answer> {
        if self.run.demand.as_ref().is_some_and(|demand| !demand.is_watched()) {
            return Err(Answer::failed("nobody watches, so the camera is closed: there is no picture"));
        }
        let picture = self.run.release.picture(PATIENCE);
        let picture =
            picture.ok_or_else(|| Answer::failed(format!("no picture came for {} s", PATIENCE.as_secs())))?;
        let path = to.map_or_else(|| Folders::of_user().free_picture(), Path::to_owned);
        let write = || -> Result<(), CliError> {
            make_folder_of(&path)?;
            Ok(still::write_color(&path, &picture, false)?)
        };
        write().map(|()| path.clone()).map_err(|error| refused(&error))
    }
}

//! Remote control of a running stream: status, switching, looks, snapshots.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::controlled::to_answer;
use crate::error::CliError;
use crate::log;
use bokehcam::budget::Quality;
use bokehcam::clock::Clock;
use bokehcam::computing::ExecutorFactory;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Change, Look, LookFacts, Patch};
use bokehcam_files::user_folders::{Folders, timestamped_stem};
use bokehcam_live::control::{Answer, Claim, Server, Status, bus};
use bokehcam_live::controller::{Changed, CommandLine, ControllableRun, Controller, refuse_look};
use bokehcam_live::pipeline::{ChangeSender, Progress};
use bokehcam_live::sink::ShutterControl;
use bokehcam_live::source::{DepthOrigin, Kind};
use bokehcam_live::stats::FrameRateMeter;
use bokehcam_media::recording::snapshot::{self, Snapshot};

/// Maximum wait for a picture to save.
const PICTURE_TIMEOUT: Duration = Duration::from_secs(2);

/// The initial look, and the means to change it.
pub(super) struct LookChanger {
    pub look: Look,
    pub changes: ChangeSender,
    pub executors: ExecutorFactory,
}

/// Control server of a stream; stops when dropped.
pub(super) struct ControlServer {
    /// Dropped first, so that no further bus calls arrive.
    bus: Option<bus::Bus>,
    server: Option<Server>,
    /// Thread that creates executors, which is too slow for an answer.
    looks: Option<JoinHandle<()>>,
}

impl Drop for ControlServer {
    fn drop(&mut self) {
        drop(self.bus.take());
        // Dropping the server drops the sender that the thread waits for.
        drop(self.server.take());
        // A panic has already been printed.
        let _ = self.looks.take().map(JoinHandle::join);
    }
}

/// Run state that the control interface exposes.
pub(super) struct RunInfo {
    /// Constant part of the status.
    pub status: Status,
    /// What looks may be.
    pub facts: LookFacts,
    pub kind: Kind,
    pub depth_from: DepthOrigin,
    /// Watchers of the outputs, if they are counted.
    pub demand: Option<Demand>,
    /// Closes the outputs, and captures pictures.
    pub shutter: ShutterControl,
    pub stats: Arc<RunStats>,
}

/// A stream and its current look.
struct Stream {
    run: RunInfo,
    /// The latest requested look. Locked by requests and by the thread that creates executors, never by the frame path.
    look: Arc<Mutex<Look>>,
    /// Queue of looks to apply.
    new_looks: Sender<Look>,
}

/// Frame statistics for the status, updated without locks.
pub(super) struct RunStats {
    clock: Clock,
    pulse: FrameRateMeter,
    /// Quality level of the last frame, as its index plus 1; 0 if it was not blurred.
    level: AtomicU8,
}

impl Default for RunStats {
    fn default() -> Self {
        Self { clock: Clock::system(), pulse: FrameRateMeter::default(), level: AtomicU8::new(0) }
    }
}

impl RunStats {
    /// Records a delivered frame.
    pub fn record(&self, progress: &Progress) {
        self.pulse.record_frame(self.clock.now_ns());
        let level = progress.quality.and_then(|quality| Quality::ALL.iter().position(|other| *other == quality));
        self.level.store(level.map_or(0, |level| level as u8 + 1), Ordering::Relaxed);
    }

    fn quality(&self) -> Option<Quality> {
        let level = usize::from(self.level.load(Ordering::Relaxed)).checked_sub(1)?;
        Quality::ALL.get(level).copied()
    }
}

/// Starts the control server. With `tray`, the names of presets to show, it also serves the session's
/// message bus and the tray icon.
///
/// # Errors
/// Fails if a thread cannot be created.
pub(super) fn serve(
    claim: Claim,
    run: RunInfo,
    looks: LookChanger,
    command_line: CommandLine,
    tray: Option<Vec<String>>,
) -> Result<ControlServer, CliError> {
    let no_thread = |error| CliError::io("a thread that answers `bokehcam ctl`".as_ref())(error);
    let look = Arc::new(Mutex::new(looks.look.clone()));
    let (new_looks, requests) = mpsc::channel();
    let (size, requested) = (run.facts.size, Arc::clone(&look));
    let apply = move || apply_looks(looks, size, &requests, &requested);
    let looks = thread::Builder::new().name("looks".into()).spawn(apply).map_err(no_thread)?;
    // The bus wraps the handler, so it has to start before the socket's server.
    let handler =
        Controller::create_handler(claim.name().clone(), "stream", command_line, Stream { run, look, new_looks });
    let (bus, handler) = match tray.map(|presets| bus::serve(Arc::clone(&handler), presets)) {
        Some(Ok((bus, handler))) => (Some(bus), handler),
        Some(Err(why)) => {
            tracing::warn!("--tray: {why}");
            (None, handler)
        }
        None => (None, handler),
    };
    let server = claim.serve(handler).map_err(no_thread)?;
    Ok(ControlServer { bus, server: Some(server), looks: Some(looks) })
}

/// Applies requested looks until all senders are gone.
fn apply_looks(looks: LookChanger, size: (u32, u32), requests: &Receiver<Look>, requested: &Mutex<Look>) {
    let LookChanger { look: mut applied, mut changes, mut executors, .. } = looks;
    let mut number = 0;
    while let Ok(look) = requests.recv() {
        // Only the last queued look counts.
        let look = requests.try_iter().last().unwrap_or(look);
        number += 1;
        match changes.switch_look(look.clone(), number, |settings| executors.create_blur(settings, size)) {
            Ok(()) => applied = look,
            Err(error) => {
                log::error(&format!("the look stays as it was: {error}"));
                let mut requested = lock(requested);
                // Keep a newer request.
                if *requested == look {
                    requested.clone_from(&applied);
                }
            }
        }
    }
}

fn lock(look: &Mutex<Look>) -> MutexGuard<'_, Look> {
    look.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ControllableRun for Stream {
    fn status(&self) -> Result<Status, Answer> {
        let RunInfo { status, demand, shutter, stats, .. } = &self.run;
        let look = lock(&self.look);
        Ok(Status {
            on: !shutter.is_closed(),
            watched: demand.as_ref().map(Demand::has_watchers),
            quality: stats.quality().map(|quality| quality.name().to_owned()),
            fps: stats.pulse.per_second(stats.clock.now_ns()),
            private: look.is_private(),
            look: Patch::describe(&look),
            ..status.clone()
        })
    }

    fn switch_pictures(&self, on: Option<bool>) -> Result<bool, Answer> {
        let shutter = &self.run.shutter;
        let Some(on) = on else { return Ok(!shutter.toggle()) };
        shutter.close(!on);
        Ok(on)
    }

    fn shutter(&self) -> Option<ShutterControl> {
        Some(self.run.shutter.clone())
    }

    fn change_look(&self, change: Change) -> Result<Changed, Answer> {
        let mut requested = lock(&self.look);
        let (look, note) = requested.change(&change, &self.run.facts).map_err(|error| refuse_look(&error))?;
        if look != *requested {
            // Sending fails only if the stream has just ended.
            let _ = self.new_looks.send(look.clone());
            requested.clone_from(&look);
        }
        Ok(Changed { look, note, source: Some((self.run.kind, self.run.depth_from)) })
    }

    fn set_depth_source(&self, way: &str) -> Result<(), Answer> {
        Err(Answer::invalid_request(format!(
            "a running stream cannot change its depth: restart it with --depth {way}, or use a preview"
        )))
    }

    fn save_snapshot(&self, to: Option<&Path>) -> Result<PathBuf, Answer> {
        if self.run.demand.as_ref().is_some_and(|demand| !demand.is_watched()) {
            return Err(Answer::failed("no program reads it, so the camera is closed: there is no picture"));
        }
        let picture = self.run.shutter.copy_next_picture(PICTURE_TIMEOUT);
        let picture =
            picture.ok_or_else(|| Answer::failed(format!("no picture came for {} s", PICTURE_TIMEOUT.as_secs())))?;
        // The focus stays a rule, as the picture comes without its distance.
        let look = lock(&self.look).clone();
        let quality = self.run.stats.quality().or(look.quality);
        let privacy = look.privacy_outside_call();
        let settings = Patch::from_look(&Look { quality, privacy, ..look }).values();
        let source = self.run.kind.name();
        let snapshot = Snapshot { picture: &picture, sources: None, settings: &settings, source };
        let saved = match to {
            Some(path) => snapshot::save_as(path, &snapshot).map(|()| path.to_owned()),
            None => snapshot::save(&Folders::from_user_dirs().pictures, &timestamped_stem(), &snapshot),
        };
        saved.map_err(|error| to_answer(&error.into()))
    }
}

//! The session: a background thread that opens sources, runs the pipeline, creates executors for new looks, and starts
//! and stops outputs, without blocking the window.

mod held;
mod outputs;
mod pipeline_run;
mod worker;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, SyncSender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

pub use held::Still;
use outputs::Outputs;
use worker::SessionWorker;

use super::services::{CliOption, Services};
use super::state::{Output, Request, Update};
use bokehcam::depth::plate::Guide;
use bokehcam::link::Receiver;
use bokehcam::link::demand::Demand;
use bokehcam::look::Look;
use bokehcam_files::user_folders::{self as folders, Folders};
use bokehcam_live::capture::Seeker;
use bokehcam_live::control::Answer;
use bokehcam_live::pipeline::{OutputRequest, PipelineError, View};
use bokehcam_live::sink::ShutterControl;
use bokehcam_live::sink::tee_control::MemberEvent;
use bokehcam_live::stats::Report;

/// A slower close is logged.
const SLOW_CLOSE: Duration = Duration::from_secs(3);

/// Wakes the window's thread to receive events; callable from any thread.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Initial configuration of a session.
pub struct SessionConfig {
    /// Opens sources and outputs, and creates executors.
    pub services: Box<dyn Services>,
    pub look: Look,
    /// Name of the source; empty for the first camera, or without a camera the demonstration.
    pub source: String,
    /// Outputs that start with the source.
    pub outputs: Vec<Output>,
    /// Whether to count failed frames and continue.
    pub keep_going: bool,
    /// Time budget for the blur of a frame; `None` for the frame period.
    pub budget_ns: Option<u64>,
    /// Number of threads for depth post-processing.
    pub threads: usize,
    /// Folders for snapshots and recordings.
    pub folders: Folders,
    /// Whether the pipeline must deliver blurred frames.
    pub output_request: Arc<OutputRequest>,
    /// Counts the viewers: sources pause while there are none.
    pub demand: Demand,
    /// Whether outputs get the still card instead of the picture.
    pub off: Arc<AtomicBool>,
}

/// Events from a session to the window.
pub enum SessionEvent {
    Update(Update),
    /// A new run: receiver of its frames, progress of its background plate, and seek handle if it is a recording.
    RunStarted(Receiver<View>, Option<Arc<Guide>>, Option<Arc<Seeker>>),
    /// Text for the clipboard.
    Copy(String),
    /// The held frame with a new look.
    Reblurred(Box<Still>),
}

/// Options of a save.
pub struct SaveOptions {
    /// Whether the input images are saved as well.
    pub with_sources: bool,
    /// The remote request, if it is one.
    pub request: Option<SnapshotRequest>,
}

/// A snapshot requested by remote control.
pub struct SnapshotRequest {
    /// Path of the file; `None` for the snapshot folder.
    pub to: Option<PathBuf>,
    pub answer: SyncSender<Result<PathBuf, Answer>>,
}

/// Result of a session.
#[derive(Debug, Default)]
pub struct SessionOutcome {
    /// Report of the last run.
    pub report: Option<Report>,
    /// One-line message of the first output that failed.
    pub output_error: Option<String>,
}

/// Commands to the session's thread.
enum Command {
    Request(Request),
    SaveFrame(Box<Still>, SaveOptions),
    HoldFrame(Box<Still>, bool),
    ReleaseFrame,
    CopyText(Vec<CliOption>),
    OutputEvent(MemberEvent),
    /// The run with this number ended.
    RunEnded(u64, Box<Result<Report, PipelineError>>),
    Close,
}

/// The window's handle to a session.
pub struct Session {
    commands: mpsc::Sender<Command>,
    events: mpsc::Receiver<SessionEvent>,
    shutter: ShutterControl,
    thread: JoinHandle<SessionOutcome>,
}

impl Session {
    /// Starts the thread, which opens the source immediately.
    ///
    /// # Errors
    /// Fails if a thread cannot be created.
    pub fn start(config: SessionConfig, wake: Wake) -> std::io::Result<Self> {
        let (commands, inbox) = mpsc::channel();
        let (sender, events) = mpsc::channel();
        let (own_commands, to_worker) = (commands.clone(), commands.clone());
        // Fails only if the session has ended.
        let on_output_event = move |event| drop(to_worker.send(Command::OutputEvent(event)));
        let (outputs, shutter) = Outputs::new(&config, on_output_event)?;
        let thread = thread::Builder::new().name("session".into()).spawn(move || {
            SessionWorker::new(config, outputs, EventSender { sender, wake }, own_commands).run(&inbox)
        })?;
        Ok(Self { commands, events, shutter, thread })
    }

    /// Returns the switch that withholds pictures from the outputs.
    pub fn shutter(&self) -> ShutterControl {
        self.shutter.clone()
    }

    /// Sends a request; ignored if the session has ended.
    pub fn send(&self, request: Request) {
        let _ = self.commands.send(Command::Request(request));
    }

    /// Sends a frame to be saved.
    pub fn save_frame(&self, still: Still, saving: SaveOptions) {
        let _ = self.commands.send(Command::SaveFrame(Box::new(still), saving));
    }

    /// Holds a frame: it is blurred again with every new look until [`Self::release_frame`]. With `is_outdated` it is blurred
    /// immediately, because it does not have the latest look yet.
    pub fn hold_frame(&self, still: Still, is_outdated: bool) {
        let _ = self.commands.send(Command::HoldFrame(Box::new(still), is_outdated));
    }

    /// Releases the held frame.
    pub fn release_frame(&self) {
        let _ = self.commands.send(Command::ReleaseFrame);
    }

    /// Requests the equivalent command for the clipboard; `cli_options` are the window's options.
    pub fn copy_command(&self, cli_options: Vec<CliOption>) {
        let _ = self.commands.send(Command::CopyText(cli_options));
    }

    /// Returns the next event without blocking.
    pub fn try_recv_event(&self) -> Option<SessionEvent> {
        self.events.try_recv().ok()
    }

    /// Ends the run, completes all outputs, and waits for the thread.
    pub fn close(self) -> SessionOutcome {
        let _ = self.commands.send(Command::Close);
        // Disconnects first: events are not received any more.
        drop(self.events);
        let began = Instant::now();
        let mut has_warned = false;
        while !self.thread.is_finished() {
            thread::sleep(Duration::from_millis(20));
            if !has_warned && began.elapsed() > SLOW_CLOSE {
                tracing::warn!("waiting for the source or an output to end; Ctrl-C twice aborts");
                has_warned = true;
            }
        }
        self.thread.join().unwrap_or_default()
    }
}

/// Sends events to the window and wakes it.
#[derive(Clone)]
struct EventSender {
    sender: mpsc::Sender<SessionEvent>,
    wake: Wake,
}

impl EventSender {
    fn send_update(&self, update: Update) {
        self.send(SessionEvent::Update(update));
    }

    fn note(&self, line: impl Into<String>) {
        let line = line.into();
        tracing::info!("{line}");
        self.send_update(Update::Note(line));
    }

    /// Reports the folder of a saved file.
    fn report_saved(&self, file: &Path) {
        folders::parent_folder(file).into_iter().for_each(|folder| self.send_update(Update::SavedIn(folder)));
    }

    /// Opens a folder in the file manager; reports failures as a note.
    fn open_folder(&self, folder: PathBuf) {
        let events = self.clone();
        folders::open_in_file_manager(folder, move |line| events.note(line));
    }

    fn send(&self, event: SessionEvent) {
        let _ = self.sender.send(event);
        (self.wake)();
    }
}

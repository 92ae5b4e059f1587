//! What goes on behind the window: a thread of its own opens sources, runs the pipeline, makes executors for new looks,
//! and begins and ends outputs. None of it holds up the window.

mod held;
mod host;
mod live;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, SyncSender};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

pub use held::Still;
use host::Host;

use super::services::{Services, Switch};
use super::state::{Output, Request, Update};
use bokehcam::capture::Seeker;
use bokehcam::control::Answer;
use bokehcam::depth::plate::Guide;
use bokehcam::files::user_folders::{self as folders, Folders};
use bokehcam::link::Receiver;
use bokehcam::link::demand::Demand;
use bokehcam::look::Look;
use bokehcam::pipeline::{PipelineError, View, Wanted};
use bokehcam::sink::Release;
use bokehcam::sink::switch::Notice;
use bokehcam::stats::Report;

/// A close that takes longer is logged.
const PATIENCE: Duration = Duration::from_secs(3);

/// Wakes the window's thread to take events; called from any thread.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// What a session starts with.
pub struct Start {
    /// Opens sources and outputs, and makes executors.
    pub services: Box<dyn Services>,
    pub look: Look,
    /// The source; empty for the first camera there is, else the demonstration.
    pub source: String,
    /// Outputs to start together with the source.
    pub outputs: Vec<Output>,
    /// Count frames that fail and go on.
    pub keep_going: bool,
    /// Time that a frame's blur may take; `None` is the frame period.
    pub budget_ns: Option<u64>,
    /// Threads that finish depth.
    pub threads: usize,
    /// Where snapshots and recordings go.
    pub folders: Folders,
    /// Where blurred pictures are wanted.
    pub wanted: Arc<Wanted>,
    /// Whether anybody watches: sources rest while nobody does.
    pub demand: Demand,
    /// Whether outputs have the still card in place of pictures.
    pub off: Arc<AtomicBool>,
    /// By what it is known whether they do.
    pub release: CurrentRelease,
}

/// What keeps pictures from the outputs of the run that there is. Locked when a run begins, and by who asks from outside.
pub type CurrentRelease = Arc<Mutex<Option<Release>>>;

/// What comes from a session.
pub enum SessionEvent {
    Update(Update),
    /// A new run started: its frames come from here, how far its plate is, if that makes its depth, and what goes back and
    /// forth in it, if it is a recording.
    Views(Receiver<View>, Option<Arc<Guide>>, Option<Arc<Seeker>>),
    /// A text for the clipboard.
    Copy(String),
    /// The frame that stays, in another look.
    Blurred(Box<Still>),
}

/// How a frame is saved.
pub struct Saving {
    /// Whether what it was made from is saved beside it.
    pub with_sources: bool,
    /// Who asked for it from outside.
    pub order: Option<StillOrder>,
}

/// A frame that somebody else asked for.
pub struct StillOrder {
    /// The file; `None` is where snapshots usually go.
    pub to: Option<PathBuf>,
    pub answer: SyncSender<Result<PathBuf, Answer>>,
}

/// What is left of a session.
#[derive(Debug, Default)]
pub struct Closed {
    /// The report of the last run, if there was one.
    pub report: Option<Report>,
    /// Why an output failed, the first that did: one line.
    pub failed: Option<String>,
}

/// What a session is to do.
enum Order {
    Do(Request),
    Save(Box<Still>, Saving),
    Hold(Box<Still>, bool),
    LetGo,
    Copy(Vec<Switch>),
    /// What became of an output of the run of this number.
    Wrote(u64, Notice),
    /// The run of this number ended.
    Ended(u64, Box<Result<Report, PipelineError>>),
    Close,
}

/// The window's handle of a session.
pub struct Session {
    orders: mpsc::Sender<Order>,
    heard: mpsc::Receiver<SessionEvent>,
    thread: JoinHandle<Closed>,
}

impl Session {
    /// Starts the thread, which opens the source at once.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn begin(start: Start, wake: Wake) -> std::io::Result<Self> {
        let (orders, inbox) = mpsc::channel();
        let (told, heard) = mpsc::channel();
        let to_itself = orders.clone();
        let thread = thread::Builder::new()
            .name("session".into())
            .spawn(move || Host::new(start, News { told, wake }, to_itself).run(&inbox))?;
        Ok(Self { orders, heard, thread })
    }

    /// Asks for a request to be carried out; ignored after the end.
    pub fn order(&self, request: Request) {
        let _ = self.orders.send(Order::Do(request));
    }

    /// Asks for a frame to be saved.
    pub fn save(&self, still: Still, saving: Saving) {
        let _ = self.orders.send(Order::Save(Box::new(still), saving));
    }

    /// This frame stays: it is to be blurred anew with every look, until it is [let go](Self::let_go); at once if it `is_behind`,
    /// as it still waits for the look that was chosen before it stayed.
    pub fn hold(&self, still: Still, is_behind: bool) {
        let _ = self.orders.send(Order::Hold(Box::new(still), is_behind));
    }

    /// No frame stays any more.
    pub fn let_go(&self) {
        let _ = self.orders.send(Order::LetGo);
    }

    /// Asks for the equivalent command, for the clipboard; `switches` are the window's options.
    pub fn copy(&self, switches: Vec<Switch>) {
        let _ = self.orders.send(Order::Copy(switches));
    }

    /// The next event, if one is waiting.
    pub fn hear(&self) -> Option<SessionEvent> {
        self.heard.try_recv().ok()
    }

    /// Ends the run and completes all outputs.
    pub fn close(self) -> Closed {
        let _ = self.orders.send(Order::Close);
        // Nobody will take its events any more.
        drop(self.heard);
        let began = Instant::now();
        let mut told = false;
        while !self.thread.is_finished() {
            thread::sleep(Duration::from_millis(20));
            if !told && began.elapsed() > PATIENCE {
                tracing::warn!("waiting for the source or an output to end; Ctrl-C twice aborts");
                told = true;
            }
        }
        self.thread.join().unwrap_or_default()
    }
}

/// Sends events to the window, and wakes it.
#[derive(Clone)]
struct News {
    told: mpsc::Sender<SessionEvent>,
    wake: Wake,
}

impl News {
    fn tell(&self, told: Update) {
        self.send(SessionEvent::Update(told));
    }

    fn note(&self, line: impl Into<String>) {
        let line = line.into();
        tracing::info!("{line}");
        self.tell(Update::Note(line));
    }

    /// Tells in which folder a file is now.
    fn kept(&self, file: &Path) {
        folders::folder_of(file).into_iter().for_each(|folder| self.tell(Update::Kept(folder)));
    }

    /// Shows a folder, and tells why not.
    fn open(&self, folder: PathBuf) {
        let news = self.clone();
        folders::open(folder, move |line| news.note(line));
    }

    fn send(&self, heard: SessionEvent) {
        let _ = self.told.send(heard);
        (self.wake)();
    }
}

//! Remote control of the window: its requests run on the window's thread, like user actions.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::time::{Duration, Instant};

use winit::event_loop::{ActiveEventLoop, EventLoopProxy};

use super::App;
use crate::remote_changes::RemoteChanges;
use crate::session::SnapshotRequest;
use crate::state::{Action, DepthMethod, Source};
use crate::window::{RemoteConfig, UserEvent};
use bokehcam::look::{Change, Look, Patch};
use bokehcam_live::control::{Answer, Server, Status};
use bokehcam_live::controller::{Changed, ControllableRun, Controller, refuse_look};
use bokehcam_live::sink::ShutterControl;
use bokehcam_live::source::DepthOrigin;

/// Timeout for replies of the window's thread, and for saving pictures.
const REPLY_TIMEOUT: Duration = Duration::from_secs(3);

/// A closure that the window's thread runs for remote control.
type Task = Box<dyn FnOnce(&mut App, &ActiveEventLoop) + Send>;

/// Handle with which remote control reaches the window.
struct RemoteHandle {
    tasks: Sender<Task>,
    proxy: EventLoopProxy<UserEvent>,
    shutter: ShutterControl,
}

/// The control server, and its state on the window's side.
pub(super) struct RemoteControl {
    /// The first field, so that it is dropped first: pending requests then fail instead of timing out.
    tasks: Receiver<Task>,
    _server: Server,
    /// Look changes by remote control, which are not saved.
    remote_changes: RemoteChanges,
    /// A requested snapshot that waits for its frame.
    request: Option<SnapshotRequest>,
}

impl RemoteControl {
    pub fn start(
        RemoteConfig { claim, command_line }: RemoteConfig,
        shutter: ShutterControl,
        proxy: &EventLoopProxy<UserEvent>,
    ) -> std::io::Result<Self> {
        let (to, tasks) = mpsc::channel();
        let handle = RemoteHandle { tasks: to, proxy: proxy.clone(), shutter };
        let handler = Controller::create_handler(claim.name().clone(), "preview", command_line, handle);
        Ok(Self { tasks, _server: claim.serve(handler)?, remote_changes: RemoteChanges::default(), request: None })
    }

    /// Takes the pending snapshot request.
    pub fn take_request(&mut self) -> Option<SnapshotRequest> {
        self.request.take()
    }
}

impl RemoteHandle {
    /// Runs a closure on the window's thread, and waits for its result.
    fn run_on_window<T: Send + 'static>(
        &self,
        what: impl FnOnce(&mut App, &ActiveEventLoop) -> T + Send + 'static,
    ) -> Result<T, Answer> {
        let (to, done) = mpsc::sync_channel(1);
        // Ignored if the requester has timed out.
        let task: Task = Box::new(move |app, events| drop(to.try_send(what(app, events))));
        self.tasks.send(task).map_err(|_| Answer::failed("the window is closed"))?;
        // Fails only if the event loop has ended.
        let _ = self.proxy.send_event(UserEvent::Control);
        receive_reply(&done)
    }
}

/// Receives a reply, with a timeout.
fn receive_reply<T>(from: &Receiver<T>) -> Result<T, Answer> {
    from.recv_timeout(REPLY_TIMEOUT).map_err(|_| Answer::failed("the window does not answer in time"))
}

impl ControllableRun for RemoteHandle {
    fn status(&self) -> Result<Status, Answer> {
        self.run_on_window(|app, _| app.status())
    }

    fn switch_pictures(&self, on: Option<bool>) -> Result<bool, Answer> {
        self.run_on_window(move |app, events| {
            let on = on.unwrap_or(app.state.off);
            app.perform_action(Action::Off(!on), events);
            on
        })
    }

    fn shutter(&self) -> Option<ShutterControl> {
        Some(self.shutter.clone())
    }

    fn change_look(&self, change: Change) -> Result<Changed, Answer> {
        self.run_on_window(move |app, events| app.change_look_temporarily(&change, events))?
    }

    fn set_depth_source(&self, depth_method: &str) -> Result<(), Answer> {
        let depth_method = depth_method.parse().map_err(Answer::invalid_request)?;
        self.run_on_window(move |app, events| {
            app.check_depth_method(depth_method)?;
            app.perform_action(Action::SetDepthMethod(depth_method), events);
            Ok(())
        })?
    }

    fn save_snapshot(&self, to: Option<&Path>) -> Result<PathBuf, Answer> {
        let to = to.map(Path::to_owned);
        let (answer, saved) = mpsc::sync_channel(1);
        self.run_on_window(move |app, _| app.snapshot_for_remote(to, answer))??;
        receive_reply(&saved)?
    }
}

impl App {
    /// Runs the queued requests of remote control.
    pub(super) fn run_remote_tasks(&mut self, events: &ActiveEventLoop) {
        while let Some(task) = self.remote_control.as_ref().and_then(|remote| remote.tasks.try_recv().ok()) {
            task(self, events);
        }
    }

    /// Changes the look, and does not save that.
    fn change_look_temporarily(&mut self, change: &Change, events: &ActiveEventLoop) -> Result<Changed, Answer> {
        let facts = self.state.look_facts();
        let (look, note) = self.state.look.change(change, &facts).map_err(|error| refuse_look(&error))?;
        let before = self.state.chosen_look();
        self.perform_action(Action::Look { look: Box::new(look.clone()), stroke: None }, events);
        let after = self.state.chosen_look();
        self.remote_control.iter_mut().for_each(|remote| remote.remote_changes.record(&before, &after));
        let source = match &self.state.source {
            Source::Running(running) if running.has_depth => Some((running.kind, running.depth_from)),
            Source::Running(running) => Some((running.kind, DepthOrigin::Nothing)),
            _ => None,
        };
        Ok(Changed { look, note, source })
    }

    /// Checks that the source supports this depth method; the error lists those it supports.
    fn check_depth_method(&self, depth_method: DepthMethod) -> Result<(), Answer> {
        let depth_methods = self.state.depth_methods();
        if depth_methods.contains(&depth_method) {
            return Ok(());
        }
        let there = match depth_methods {
            [] => "it has no source of depth".to_owned(),
            methods => format!("use {}", methods.iter().map(DepthMethod::to_string).collect::<Vec<_>>().join(", ")),
        };
        Err(Answer::invalid_request(format!("{depth_method} is not available for this source: {there}")))
    }

    /// Returns the look to be saved: without changes by remote control.
    pub(super) fn look_to_save(&self) -> Look {
        let look = self.state.chosen_look();
        self.remote_control.as_ref().map_or_else(|| look.clone(), |remote| remote.remote_changes.remove_from(&look))
    }

    /// Saves the displayed frame, and sends the result to `answer`.
    fn snapshot_for_remote(
        &mut self,
        to: Option<PathBuf>,
        answer: SyncSender<Result<PathBuf, Answer>>,
    ) -> Result<(), Answer> {
        if self.view.is_none() {
            return Err(Answer::failed("there is no picture yet"));
        }
        if let Some(remote_control) = &mut self.remote_control {
            remote_control.request = Some(SnapshotRequest { to, answer });
            self.save_snapshot();
        }
        Ok(())
    }

    /// Blocks or unblocks pictures, both for the screen and the outputs.
    pub(super) fn set_off(&mut self, off: bool) {
        self.off.store(off, Ordering::Release);
        self.last_frame_at = Instant::now();
        if off {
            (self.view, self.held_number, self.snapshot_due) = (None, None, false);
            self.session.release_frame();
        }
    }

    fn status(&self) -> Status {
        let state = &self.state;
        let size = match &state.source {
            Source::Running(running) => Some(running.size),
            _ => None,
        };
        let outputs = state.outputs.iter().map(|output| output.name.clone());
        let is_moving =
            size.is_some() && !state.off && !state.frozen && state.silent_s.is_none() && self.watch.is_some();
        Status {
            on: !state.off,
            source: state.source_name.clone(),
            size,
            depth: state.depth_method().map(|depth_method| depth_method.to_string()),
            sinks: ["window".to_owned()].into_iter().chain(outputs).collect(),
            watched: Some(state.is_watched),
            quality: self.view.as_ref().and_then(|view| Some(view.trace.quality?.name().to_owned())),
            fps: if is_moving { self.meters.frame_rate.per_second(self.clock.now_ns()) } else { 0.0 },
            private: state.effective_look().is_private(),
            look: Patch::describe(&state.look),
            ..Status::default()
        }
    }
}

//! Sources that appear, are offered, or are chosen during the session.

use std::sync::mpsc;
use std::time::Duration;

use super::SessionWorker;
use crate::services::PathKind;
use crate::session::{Command, EventSender};
use crate::state::{Request, Update};
use bokehcam::look::BackgroundSetting;
use bokehcam_files::atomic_file;
use bokehcam_live::source::video::is_video;

/// Interval of checks for new devices, for readers of virtual cameras, and of the recording's size.
const CHECK_PERIOD: Duration = Duration::from_secs(1);

impl SessionWorker {
    /// Waits for the next command, and meanwhile checks for changes of devices and readers. `None` if all senders are gone.
    pub(super) fn next_command(&mut self, inbox: &mpsc::Receiver<Command>) -> Option<Command> {
        loop {
            match inbox.recv_timeout(CHECK_PERIOD) {
                Ok(command) => return Some(command),
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    self.report_recording_size();
                    self.outputs.remove_unread();
                    self.follow_calls(false);
                    self.report_readers();
                    self.check_devices();
                }
                Err(mpsc::RecvTimeoutError::Disconnected) => return None,
            }
        }
    }

    /// Reports the current size of the recording.
    fn report_recording_size(&self) {
        let recording = self.outputs.list().into_iter().find(|output| !output.is_camera);
        let bytes = recording.and_then(|output| atomic_file::bytes_written(output.name.as_ref()));
        bytes.into_iter().for_each(|bytes| self.events.send_update(Update::RecordedBytes(bytes)));
    }

    pub(super) fn report_choices(&mut self) {
        let sources = self.config.services.list_sources();
        let virtual_cameras = self.config.services.list_virtual_cameras();
        self.events.send_update(Update::Choices { sources, virtual_cameras });
        self.events.send_update(Update::Presets(self.config.services.settings().presets()));
    }

    /// Reports device changes, and reopens a missing source that has come back.
    fn check_devices(&mut self) {
        if !self.config.services.have_devices_changed() {
            return;
        }
        self.report_choices();
        let source = &self.config.source;
        let is_camera = source.starts_with("/dev/") || source.starts_with("pipewire:");
        let is_there = self.config.services.list_sources().iter().any(|choice| choice.name == *source);
        if self.pipeline.is_none() && is_there && is_camera {
            return self.open_source();
        }
        // A recording gets no other picture unasked.
        if self.outputs.list().iter().all(|output| output.is_camera)
            && let Some(camera) = self.config.services.awaited_camera()
        {
            self.events.send_update(Update::CameraFound(camera));
        }
    }

    /// Reports an offered source as valid, or else why not; the current source continues.
    pub(super) fn check_offer(&self, name: String) {
        match self.config.services.check_source_name(&name) {
            Ok(()) => self.events.send_update(Update::Offered(name)),
            Err(line) => self.events.note(line),
        }
    }

    /// Opens a file chooser on its own thread.
    pub(super) fn open_file_chooser(&self, what: PathKind) {
        let (commands, events) = (self.commands.clone(), self.events.clone());
        let choose_path = self.config.services.create_file_chooser(what);
        let spawned = std::thread::Builder::new().name("dialog".into()).spawn(move || match choose_path() {
            Ok(Some(file)) if what == PathKind::Background => load_background(file, &events),
            Ok(Some(name)) => drop(commands.send(Command::Request(Request::Offer(name)))),
            Ok(None) => {}
            Err(line) => events.note(line),
        });
        if let Err(error) = spawned {
            self.events.note(format!("there is no dialog: {error}"));
        }
    }

    /// Reads a picture or video as the background, on its own thread.
    pub(super) fn load_background(&self, file: String) {
        let events = self.events.clone();
        let spawned =
            std::thread::Builder::new().name("background".into()).spawn(move || load_background(file, &events));
        if let Err(error) = spawned {
            self.events.note(format!("the background is not read: {error}"));
        }
    }

    /// Reopens the camera with another frame size and rate.
    pub(super) fn set_camera_mode(&mut self, size: (u32, u32), fps: f64) {
        self.config.services.set_mode(&self.config.source, size, fps);
        self.stop_run();
        self.open_source();
    }
}

/// Reads a picture or video, and reports it as the new background.
fn load_background(file: String, events: &EventSender) {
    let file = std::path::PathBuf::from(file);
    let setting = if is_video(&file) { BackgroundSetting::Video(file) } else { BackgroundSetting::Image(file) };
    match setting.load() {
        Ok(behind) => events.send_update(Update::Background(behind)),
        Err(error) => events.note(error.to_string()),
    }
}

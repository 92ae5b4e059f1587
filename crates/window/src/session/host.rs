//! The session's thread.

mod looks;
mod sources;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc;

use super::live::Live;
use super::{Closed, Command, EventSender, SessionEvent, Start, held};
use crate::services::CliOption;
use crate::state::{DepthMethod, Output, Request, Source, Update};
use bokehcam::files::user_folders as folders;
use bokehcam::link::demand::Watch;
use bokehcam::look::Look;
use bokehcam::pipeline::PipelineError;
use bokehcam::sink::switch::{MemberState, Notice};
use bokehcam::sink::{self, Target};
use bokehcam::stats::Report;

/// State of the session, owned by its thread.
pub(super) struct Host {
    /// Configuration; look, source and outputs are kept current.
    start: Start,
    /// Depth method that the user requested; `None` for the default.
    depth_method: Option<DepthMethod>,
    /// Held while an output is active, to keep the source from pausing.
    watch: Option<Watch>,
    events: EventSender,
    commands: mpsc::Sender<Command>,
    live: Option<Live>,
    /// Number of runs so far, which is the number of the current run.
    runs: u64,
    report: Option<Report>,
    /// Message of the first output that failed.
    failed: Option<String>,
    /// Whether a run has ever started.
    began: bool,
    /// Recent looks of the current run with their change numbers, oldest first.
    looks: VecDeque<(u64, Look)>,
    /// The frame held on the screen.
    held: Option<held::HeldBlur>,
}

impl Host {
    /// Creates a session that has not started yet; `commands` sends to the session itself.
    pub fn new(start: Start, events: EventSender, commands: mpsc::Sender<Command>) -> Self {
        Self {
            start,
            depth_method: None,
            watch: None,
            events,
            commands,
            live: None,
            runs: 0,
            report: None,
            failed: None,
            began: false,
            looks: VecDeque::new(),
            held: None,
        }
    }

    /// Opens the source, then processes commands until it must close.
    pub fn run(mut self, inbox: &mpsc::Receiver<Command>) -> Closed {
        self.report_choices();
        self.recover();
        self.open();
        while let Some(command) = self.next_command(inbox) {
            let mut next = Some(command);
            while let Some(command) = next.take() {
                match command {
                    // Coalesces queued looks: only the last one counts. The first other command follows it.
                    Command::Request(Request::Look(mut look)) => {
                        for command in inbox.try_iter() {
                            match command {
                                Command::Request(Request::Look(newer)) => look = newer,
                                other => {
                                    next = Some(other);
                                    break;
                                }
                            }
                        }
                        self.adopt(*look);
                    }
                    Command::Request(request) => self.carry_out(request),
                    Command::Save(still, saving) => self.save(&still, &saving),
                    Command::Hold(still, is_behind) => self.hold(*still, is_behind),
                    Command::ShutterControl => self.held = None,
                    Command::Copy(switches) => self.copy(&switches),
                    Command::OutputEvent(run, notice) => self.handle_output_event(run, &notice),
                    Command::Ended(run, ended) => self.handle_run_end(run, *ended),
                    Command::Close => return self.close(inbox),
                }
            }
        }
        self.close(inbox)
    }

    /// Ends the run, and processes the final events of its outputs.
    fn close(mut self, inbox: &mpsc::Receiver<Command>) -> Closed {
        self.stop();
        for command in inbox.try_iter() {
            if let Command::OutputEvent(run, notice) = command {
                self.handle_output_event(run, &notice);
            }
        }
        Closed { report: self.report, failed: self.failed }
    }

    /// Recovers recordings of an earlier preview that was killed.
    fn recover(&self) {
        for kept in self.start.folders.all().flat_map(|folder| sink::recover_all(folder, folders::is_video)) {
            self.events.note(format!("An earlier recording was interrupted: it is kept as {}", folders::shown(&kept)));
        }
    }

    /// Carries out a request of the window.
    fn carry_out(&mut self, request: Request) {
        match request {
            Request::Open(name) => {
                // The depth method is specific to a source.
                self.depth_method = self.depth_method.filter(|_| self.start.source == name);
                self.start.source = name;
                self.stop();
                self.open();
            }
            Request::TakePlate => match self.live.as_ref().and_then(|live| live.guide.as_ref()) {
                Some(guide) => guide.request_capture(),
                None => self.set_depth_method(DepthMethod::Plate),
            },
            Request::DepthBy(depth_method) => self.set_depth_method(depth_method),
            Request::Begin(output) => {
                self.write_to(output);
                self.report_outputs();
            }
            Request::End(output) => {
                self.start.outputs.retain(|other| *other != output);
                if let Some(live) = &self.live {
                    live.remove_output(&output);
                }
                self.report_outputs();
            }
            Request::Control(name, value) => match self.start.services.set_control(&name, value) {
                Ok(controls) => self.events.send_update(Update::Controls(controls)),
                Err(line) => self.events.note(line),
            },
            Request::OpenFolder(folder) => self.events.open(folder),
            Request::Refresh => self.report_choices(),
            Request::SavePreset(name, look) => {
                let saved = self.start.services.settings().save_preset(&name, &look);
                self.report_presets(saved, &format!("Saved as preset '{name}'"));
            }
            Request::RenamePreset(name, new) => {
                let renamed = self.start.services.settings().rename_preset(&name, &new);
                self.report_presets(renamed, &format!("Preset '{name}' is called '{new}' now"));
            }
            Request::DeletePreset(name) => {
                let deleted = self.start.services.settings().delete_preset(&name);
                self.report_presets(deleted, &format!("Preset '{name}' is deleted"));
            }
            Request::Offer(name) => self.offer(name),
            Request::Browse(what) => self.browse(what),
            Request::Mode(size, fps) => self.set_mode(size, fps),
            // The window handles all others, or they have their own command.
            _ => {}
        }
    }

    /// Reopens the source with another depth method, if it supports that.
    fn set_depth_method(&mut self, depth_method: DepthMethod) {
        if let Err(line) = self.start.services.check_depth_method(&self.start.source, depth_method) {
            return self.events.note(line);
        }
        self.depth_method = Some(depth_method);
        self.stop();
        self.open();
    }

    /// Reports the result of a preset change, and the current presets.
    fn report_presets(&mut self, changed: Result<(), String>, done: &str) {
        self.events.note(changed.map_or_else(|line| line, |()| done.to_owned()));
        self.events.send_update(Update::Presets(self.start.services.settings().presets()));
    }

    fn report_outputs(&mut self) {
        self.start.output_request.set_needed_in_memory(!self.start.outputs.is_empty());
        self.watch = (!self.start.outputs.is_empty()).then(|| self.start.demand.watch());
        self.events.send_update(Update::Outputs(self.start.outputs.clone()));
    }

    /// Reports that no source is running; `source` has the reason. Recordings end; a virtual camera continues with the
    /// next source.
    fn report_no_source(&mut self, source: Source) {
        // Before the first run, recordings requested at the start still wait for a source.
        if self.began {
            self.start.outputs.retain(|output| output.is_camera);
        }
        self.report_outputs();
        self.events.send_update(Update::Source(source));
    }

    /// Opens the source and starts its run.
    fn open(&mut self) {
        self.events.send_update(Update::Source(Source::Opening));
        let opened = match self.start.services.open(&self.start.source, self.depth_method) {
            Ok(opened) => opened,
            Err(line) => return self.report_no_source(Source::Lost(line)),
        };
        self.start.source.clone_from(&opened.name);
        self.report_choices();
        self.events.send_update(Update::Camera(opened.camera.clone()));
        self.events.send_update(Update::Controls(opened.controls.clone()));
        opened.notes.iter().for_each(|line| self.events.note(line));
        self.runs += 1;
        self.start.output_request.set_needed_in_memory(!self.start.outputs.is_empty());
        let (commands, run) = (self.commands.clone(), self.runs);
        let to_host = commands.clone();
        let wrote = move |written| {
            let _ = to_host.send(Command::OutputEvent(run, written));
        };
        let ended = move |ended| {
            let _ = commands.send(Command::Ended(run, Box::new(ended)));
        };
        match Live::begin(opened, &mut self.start, &self.events, wrote, ended) {
            Ok((live, source)) => {
                self.looks = VecDeque::from([(0, live.effective(&self.start.look))]);
                self.live = Some(live);
                self.events.send_update(Update::Source(source));
                // A recording ends with its source; a virtual camera continues with the next one.
                let first = !std::mem::replace(&mut self.began, true);
                let outputs = std::mem::take(&mut self.start.outputs);
                outputs.into_iter().filter(|output| output.is_camera || first).for_each(|output| self.write_to(output));
                self.report_outputs();
            }
            Err(line) => self.report_no_source(Source::Lost(line)),
        }
    }

    /// Opens an output and adds it to the run; an unnamed recording gets a name.
    fn write_to(&mut self, mut output: Output) {
        let Some(live) = &self.live else { return self.events.note("There is no source to record.") };
        if output.name.is_empty() {
            output.name = self.unused_video_path().display().to_string();
        }
        match self.start.services.open_output(&output.name, live.size, live.period_ns, &live.stop) {
            Ok(sink) => {
                self.start.output_request.set_needed_in_memory(true);
                live.add_output(&output, sink);
                self.start.outputs.push(output);
            }
            Err(line) => self.events.note(line),
        }
    }

    /// Returns an unused path for a recording.
    fn unused_video_path(&self) -> PathBuf {
        // A file appears under its name only when complete, so check the active outputs as well.
        self.start
            .folders
            .free_video(|path| self.start.outputs.iter().any(|output| path.as_os_str() == output.name.as_str()))
    }

    /// Copies the equivalent command to the clipboard.
    fn copy(&self, switches: &[CliOption]) {
        // The current recording's file already exists: the command gets a new name.
        let again = |output: &Output| match output.is_camera {
            true => output.name.clone(),
            false => self.unused_video_path().display().to_string(),
        };
        let outputs: Vec<String> = self.start.outputs.iter().map(again).collect();
        let look = self.effective_look();
        let command = self.start.services.format_command(&look, &self.start.source, &outputs, switches);
        self.events.note(format!("Copied: {command}"));
        self.events.send(SessionEvent::Copy(command));
    }

    /// Handles an event of an output of the run with number `run`.
    fn handle_output_event(&mut self, run: u64, Notice { member, fate }: &Notice) {
        match fate {
            MemberState::Began => self.events.note(match virtual_camera_name(member) {
                Some(camera) => format!("Calls have this picture now: choose the camera {camera}"),
                None => format!("Recording to {}", folders::shown_output(member)),
            }),
            // A virtual camera leaves no file to report.
            MemberState::Completed { .. } if virtual_camera_name(member).is_some() => {}
            MemberState::Completed { frames } => {
                self.events.note(format!("Complete: {}, {frames} frames", folders::shown_output(member)));
                self.events.report_saved(Path::new(member));
            }
            MemberState::Failed { why, .. } => {
                tracing::error!("{why}");
                self.failed.get_or_insert_with(|| why.clone());
                self.events.send_update(Update::Trouble(why.clone()));
                // An output of an earlier run may have the same name as one of the current run.
                if run == self.runs {
                    self.start.outputs.retain(|output| output.name != *member);
                    self.report_outputs();
                }
            }
        }
    }

    /// Stores the report of an ended run. If the session did not stop it, reports the source as gone.
    fn handle_run_end(&mut self, run: u64, ended: Result<Report, PipelineError>) {
        let was_stopped = run != self.runs || self.live.is_none();
        let source = match &ended {
            Ok(_) => Source::Ended,
            Err(failed) => Source::Lost(failed.fault.to_string()),
        };
        self.report = Some(match ended {
            Ok(report) => report,
            Err(failed) => *failed.report,
        });
        if !was_stopped {
            if let Some(live) = self.live.take() {
                live.join();
            }
            self.report_no_source(source);
        }
    }

    /// Ends the current run and completes its outputs.
    fn stop(&mut self) {
        self.report = self.live.take().and_then(Live::stop).or_else(|| self.report.take());
    }
}

/// Returns the name that other programs display for a virtual camera; `None` if the output is no camera.
fn virtual_camera_name(output: &str) -> Option<String> {
    let target: Target = output.parse().ok().filter(Target::is_camera)?;
    Some(match target {
        Target::PipeWire(label) => label.unwrap_or_else(|| "bokehcam".to_owned()),
        other => other.to_string(),
    })
}

//! The session's thread.

mod looks;
mod sources;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc;

use super::outputs::Outputs;
use super::pipeline_run::PipelineRun;
use super::{Command, EventSender, SessionConfig, SessionEvent, SessionOutcome, held};
use crate::services::CliOption;
use crate::state::{DepthMethod, Output, Request, Source, Update};
use bokehcam::look::Look;
use bokehcam_files::user_folders as folders;
use bokehcam_live::pipeline::PipelineError;
use bokehcam_live::sink;
use bokehcam_live::sink::tee_control::MemberEvent;
use bokehcam_live::stats::Report;

/// Shown when the virtual camera is switched off while a program reads it.
const STILL_READ: &str = "Calls see a still card now. The camera goes from their lists once they have let go of it.";

/// State of the session, owned by its thread.
pub(super) struct SessionWorker {
    /// Configuration; look and source are kept current.
    config: SessionConfig,
    outputs: Outputs,
    /// Whether a program reads a virtual camera, as reported last.
    is_watched: bool,
    /// Depth method that the user requested; `None` for the default.
    depth_method: Option<DepthMethod>,
    events: EventSender,
    commands: mpsc::Sender<Command>,
    pipeline: Option<PipelineRun>,
    /// Number of runs so far, which is the number of the current run.
    runs: u64,
    report: Option<Report>,
    /// Message of the first output that failed.
    first_failure: Option<String>,
    /// Recent looks of the current run with their change numbers, oldest first.
    looks: VecDeque<(u64, Look)>,
    /// The frame held on the screen.
    held: Option<held::HeldBlur>,
}

impl SessionWorker {
    /// Creates a session that has not started yet; `commands` sends to the session itself.
    pub fn new(config: SessionConfig, outputs: Outputs, events: EventSender, commands: mpsc::Sender<Command>) -> Self {
        Self {
            config,
            outputs,
            is_watched: false,
            depth_method: None,
            events,
            commands,
            pipeline: None,
            runs: 0,
            report: None,
            first_failure: None,
            looks: VecDeque::new(),
            held: None,
        }
    }

    /// Opens the source, then processes commands until it must close.
    pub fn run(mut self, inbox: &mpsc::Receiver<Command>) -> SessionOutcome {
        self.report_choices();
        self.recover_recordings();
        self.open_source();
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
                        self.switch_look(*look);
                    }
                    Command::Request(request) => self.handle_request(request),
                    Command::SaveFrame(still, saving) => self.save_frame(&still, &saving),
                    Command::HoldFrame(still, is_outdated) => self.hold_frame(*still, is_outdated),
                    Command::ReleaseFrame => self.held = None,
                    Command::CopyText(cli_options) => self.copy_command(&cli_options),
                    Command::OutputEvent(event) => self.handle_output_event(event),
                    Command::RunEnded(run, ended) => self.handle_run_end(run, *ended),
                    Command::Close => return self.close(inbox),
                }
            }
        }
        self.close(inbox)
    }

    /// Ends the run, and processes the final events of its outputs.
    fn close(mut self, inbox: &mpsc::Receiver<Command>) -> SessionOutcome {
        self.stop_run();
        let Self { outputs, events, report, mut first_failure, .. } = self;
        // Its errors are events as well.
        let _ = outputs.finish();
        for command in inbox.try_iter() {
            if let Command::OutputEvent(event) = command {
                first_failure = first_failure.or(events.report_output_event(event));
            }
        }
        SessionOutcome { report, output_error: first_failure }
    }

    /// Recovers recordings of an earlier preview that was killed.
    fn recover_recordings(&self) {
        for kept in
            self.config.folders.all().flat_map(|folder| sink::recover_videos(folder, folders::is_recording_name))
        {
            self.events
                .note(format!("An earlier recording was interrupted: it is kept as {}", folders::format_path(&kept)));
        }
    }

    /// Carries out a request of the window.
    fn handle_request(&mut self, request: Request) {
        match request {
            Request::Open(name) => {
                // The depth method is specific to a source.
                self.depth_method = self.depth_method.filter(|_| self.config.source == name);
                self.config.source = name;
                self.stop_run();
                self.open_source();
            }
            Request::CapturePlate => match self.pipeline.as_ref().and_then(|pipeline| pipeline.guide.as_ref()) {
                Some(guide) => guide.request_capture(),
                None => self.set_depth_method(DepthMethod::Plate),
            },
            Request::SetDepthMethod(depth_method) => self.set_depth_method(depth_method),
            Request::StartOutput(output) => {
                // The blur becomes that of a call before a call sees it.
                self.follow_calls(output.is_camera);
                self.add_output(output);
                self.report_outputs();
            }
            Request::StopOutput(output) => {
                if self.outputs.switch_off(&output) {
                    self.events.note(STILL_READ);
                }
                self.report_outputs();
            }
            Request::Control(name, value) => match self.config.services.set_control(&name, value) {
                Ok(controls) => self.events.send_update(Update::Controls(controls)),
                Err(line) => self.events.note(line),
            },
            Request::OpenFolder(folder) => self.events.open_folder(folder),
            Request::Refresh => self.report_choices(),
            Request::SavePreset(name, look) => {
                let saved = self.config.services.settings().save_preset(&name, &look);
                self.report_presets(saved, &format!("Saved as preset '{name}'"));
            }
            Request::RenamePreset(name, new) => {
                let renamed = self.config.services.settings().rename_preset(&name, &new);
                self.report_presets(renamed, &format!("Preset '{name}' is called '{new}' now"));
            }
            Request::DeletePreset(name) => {
                let deleted = self.config.services.settings().delete_preset(&name);
                self.report_presets(deleted, &format!("Preset '{name}' is deleted"));
            }
            Request::Offer(name) => self.check_offer(name),
            Request::Browse(what) => self.open_file_chooser(what),
            Request::LoadBackground(file) => self.load_background(file),
            Request::Mode(size, fps) => self.set_camera_mode(size, fps),
            // The window handles all others, or they have their own command.
            _ => {}
        }
    }

    /// Reopens the source with another depth method, if it supports that.
    fn set_depth_method(&mut self, depth_method: DepthMethod) {
        if let Err(line) = self.config.services.check_depth_method(&self.config.source, depth_method) {
            return self.events.note(line);
        }
        self.depth_method = Some(depth_method);
        self.stop_run();
        self.open_source();
    }

    /// Reports the result of a preset change, and the current presets.
    fn report_presets(&mut self, changed: Result<(), String>, done: &str) {
        self.events.note(changed.map_or_else(|line| line, |()| done.to_owned()));
        self.events.send_update(Update::Presets(self.config.services.settings().presets()));
    }

    fn report_outputs(&mut self) {
        self.follow_calls(false);
        let outputs = self.outputs.list();
        self.config.output_request.set_needed_in_memory(!outputs.is_empty());
        self.events.send_update(Update::Outputs(outputs));
        self.report_readers();
    }

    /// Reports whether a program reads a virtual camera, if that has changed.
    fn report_readers(&mut self) {
        let is_watched = self.outputs.is_watched();
        if std::mem::replace(&mut self.is_watched, is_watched) != is_watched {
            self.events.send_update(Update::Watched(is_watched));
        }
    }

    /// Reports that no source is running; `source` has the reason. Recordings end; a virtual camera shows the card until
    /// the next source.
    fn report_no_source(&mut self, source: Source) {
        self.outputs.end_source();
        self.report_outputs();
        self.events.send_update(Update::Source(source));
    }

    /// Opens the source and starts its run.
    fn open_source(&mut self) {
        self.events.send_update(Update::Source(Source::Opening));
        let opened = match self.config.services.open(&self.config.source, self.depth_method) {
            Ok(opened) => opened,
            Err(line) => return self.report_no_source(Source::Lost(line)),
        };
        self.config.source.clone_from(&opened.name);
        self.report_choices();
        self.events.send_update(Update::Camera(opened.camera.clone()));
        self.events.send_update(Update::Controls(opened.controls.clone()));
        opened.notes.iter().for_each(|line| self.events.note(line));
        self.runs += 1;
        let (commands, run) = (self.commands.clone(), self.runs);
        let ended = move |ended| {
            let _ = commands.send(Command::RunEnded(run, Box::new(ended)));
        };
        match PipelineRun::start(opened, &mut self.config, &self.events, &mut self.outputs, ended) {
            Ok((pipeline, source)) => {
                self.looks = VecDeque::from([(0, self.config.look.for_source(&pipeline.facts))]);
                self.pipeline = Some(pipeline);
                self.events.send_update(Update::Source(source));
                // Those of the command line begin with the first source.
                std::mem::take(&mut self.config.outputs).into_iter().for_each(|output| self.add_output(output));
                self.report_outputs();
            }
            Err(line) => self.report_no_source(Source::Lost(line)),
        }
    }

    /// Opens an output, or shows pictures again in one that is still read; an unnamed recording gets a name.
    fn add_output(&mut self, mut output: Output) {
        if !output.is_camera && self.pipeline.is_none() {
            return self.events.note("There is no source to record.");
        }
        if output.name.is_empty() {
            output.name = self.unused_video_path().display().to_string();
        }
        if let Err(line) = self.outputs.add(output, &mut *self.config.services) {
            self.events.note(line);
        }
    }

    /// Returns an unused path for a recording.
    fn unused_video_path(&self) -> PathBuf {
        // A file appears under its name only when complete, so check the active outputs as well.
        self.config
            .folders
            .unused_video_path(|path| self.outputs.list().iter().any(|output| path.as_os_str() == output.name.as_str()))
    }

    /// Copies the equivalent command to the clipboard.
    fn copy_command(&self, cli_options: &[CliOption]) {
        // The current recording's file already exists: the command gets a new name.
        let again = |output: &Output| match output.is_camera {
            true => output.name.clone(),
            false => self.unused_video_path().display().to_string(),
        };
        let outputs: Vec<String> = self.outputs.list().iter().map(again).collect();
        let look = self.effective_look();
        let command = self.config.services.format_command(&look, &self.config.source, &outputs, cli_options);
        self.events.note(format!("Copied: {command}"));
        self.events.send(SessionEvent::Copy(command));
    }

    /// Handles an event of an output; forgets one that has failed.
    fn handle_output_event(&mut self, event: MemberEvent) {
        let number = event.number;
        if let Some(why) = self.events.report_output_event(event) {
            self.first_failure.get_or_insert(why);
            self.outputs.forget(number);
            self.report_outputs();
        }
    }

    /// Stores the report of an ended run. If the session did not stop it, reports the source as gone.
    fn handle_run_end(&mut self, run: u64, ended: Result<Report, PipelineError>) {
        let was_stopped = run != self.runs || self.pipeline.is_none();
        let source = match &ended {
            Ok(_) => Source::Ended,
            Err(failed) => Source::Lost(failed.fault.to_string()),
        };
        self.report = Some(match ended {
            Ok(report) => report,
            Err(failed) => *failed.report,
        });
        if !was_stopped {
            if let Some(pipeline) = self.pipeline.take() {
                pipeline.join();
            }
            self.report_no_source(source);
        }
    }

    /// Ends the current run.
    fn stop_run(&mut self) {
        self.report = self.pipeline.take().and_then(PipelineRun::stop).or_else(|| self.report.take());
    }
}

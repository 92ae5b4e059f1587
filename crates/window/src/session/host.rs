//! The session's own thread.

mod looks;
mod sources;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc;

use super::live::Live;
use super::{Closed, News, Order, SessionEvent, Start, held};
use crate::services::Switch;
use crate::state::{Output, Request, Source, Update, Way};
use bokehcam::files::user_folders as folders;
use bokehcam::link::demand::Watch;
use bokehcam::look::Look;
use bokehcam::pipeline::PipelineError;
use bokehcam::sink::switch::{Fate, Notice};
use bokehcam::sink::{self, Target};
use bokehcam::stats::Report;

/// The session, on its own thread.
pub(super) struct Host {
    /// As it began; look, source and outputs are those of now.
    start: Start,
    /// The way that its depth is made, by a wish of the window's.
    way: Option<Way>,
    /// Held while something is written: then the source does not rest.
    watch: Option<Watch>,
    news: News,
    orders: mpsc::Sender<Order>,
    live: Option<Live>,
    /// Runs so far, which is also the number of the present one.
    runs: u64,
    report: Option<Report>,
    /// Why an output failed: the first that did.
    failed: Option<String>,
    /// Whether there ever was a run.
    began: bool,
    /// The last looks of the present run, each with the number of its change, oldest first.
    looks: VecDeque<(u64, Look)>,
    /// The frame that stays on the screen.
    held: Option<held::HeldBlur>,
}

impl Host {
    /// A session that has not started yet; `orders` sends orders to itself.
    pub fn new(start: Start, news: News, orders: mpsc::Sender<Order>) -> Self {
        Self {
            start,
            way: None,
            watch: None,
            news,
            orders,
            live: None,
            runs: 0,
            report: None,
            failed: None,
            began: false,
            looks: VecDeque::new(),
            held: None,
        }
    }

    /// Opens the source, then carries out orders until it is told to close.
    pub fn run(mut self, inbox: &mpsc::Receiver<Order>) -> Closed {
        self.tell_choices();
        self.recover();
        self.open();
        while let Some(order) = self.next(inbox) {
            let mut next = Some(order);
            while let Some(order) = next.take() {
                match order {
                    // Of several looks in the queue only the last counts; the order after them comes next.
                    Order::Do(Request::Look(mut look)) => {
                        for order in inbox.try_iter() {
                            match order {
                                Order::Do(Request::Look(newer)) => look = newer,
                                other => {
                                    next = Some(other);
                                    break;
                                }
                            }
                        }
                        self.adopt(*look);
                    }
                    Order::Do(request) => self.carry_out(request),
                    Order::Save(still, saving) => self.save(&still, &saving),
                    Order::Hold(still, is_behind) => self.hold(*still, is_behind),
                    Order::LetGo => self.held = None,
                    Order::Copy(switches) => self.copy(&switches),
                    Order::Wrote(run, notice) => self.on_output(run, &notice),
                    Order::Ended(run, ended) => self.on_run_end(run, *ended),
                    Order::Close => return self.close(inbox),
                }
            }
        }
        self.close(inbox)
    }

    /// Ends the run, and hears what became of its outputs.
    fn close(mut self, inbox: &mpsc::Receiver<Order>) -> Closed {
        self.stop();
        for order in inbox.try_iter() {
            if let Order::Wrote(run, notice) = order {
                self.on_output(run, &notice);
            }
        }
        Closed { report: self.report, failed: self.failed }
    }

    /// Rescues recordings of an earlier preview that was killed.
    fn recover(&self) {
        for kept in self.start.folders.all().flat_map(|folder| sink::recover_all(folder, folders::is_video)) {
            self.news.note(format!("An earlier recording was broken off: it is kept as {}", folders::shown(&kept)));
        }
    }

    /// Carries out a request of the window's.
    fn carry_out(&mut self, request: Request) {
        match request {
            Request::Open(name) => {
                // A way is of one source.
                self.way = self.way.filter(|_| self.start.source == name);
                self.start.source = name;
                self.stop();
                self.open();
            }
            Request::TakePlate => match self.live.as_ref().and_then(|live| live.guide.as_ref()) {
                Some(guide) => guide.take_again(),
                None => self.make_depth_by(Way::Plate),
            },
            Request::DepthBy(way) => self.make_depth_by(way),
            Request::Begin(output) => {
                self.write_to(output);
                self.tell_outputs();
            }
            Request::End(output) => {
                self.start.outputs.retain(|other| *other != output);
                if let Some(live) = &self.live {
                    live.end(&output);
                }
                self.tell_outputs();
            }
            Request::Control(name, value) => match self.start.services.turn(&name, value) {
                Ok(controls) => self.news.tell(Update::Controls(controls)),
                Err(line) => self.news.note(line),
            },
            Request::OpenFolder(folder) => self.news.open(folder),
            Request::Refresh => self.tell_choices(),
            Request::SavePreset(name, look) => {
                let saved = self.start.services.settings().save_preset(&name, &look);
                self.tell_presets(saved, &format!("Saved as preset '{name}'"));
            }
            Request::RenamePreset(name, new) => {
                let renamed = self.start.services.settings().rename_preset(&name, &new);
                self.tell_presets(renamed, &format!("Preset '{name}' is called '{new}' now"));
            }
            Request::DeletePreset(name) => {
                let deleted = self.start.services.settings().delete_preset(&name);
                self.tell_presets(deleted, &format!("Preset '{name}' is deleted"));
            }
            Request::Offer(name) => self.offer(name),
            Request::Browse(what) => self.browse(what),
            Request::Mode(size, fps) => self.set_mode(size, fps),
            // All else is the window's own, or comes another way.
            _ => {}
        }
    }

    /// Opens the source again with depth made another way, if it can be.
    fn make_depth_by(&mut self, way: Way) {
        if let Err(line) = self.start.services.can(&self.start.source, way) {
            return self.news.note(line);
        }
        self.way = Some(way);
        self.stop();
        self.open();
    }

    /// Tells what became of a change of the presets, and which there are now.
    fn tell_presets(&mut self, changed: Result<(), String>, done: &str) {
        self.news.note(changed.map_or_else(|line| line, |()| done.to_owned()));
        self.news.tell(Update::Presets(self.start.services.settings().presets()));
    }

    fn tell_outputs(&mut self) {
        self.start.wanted.need(!self.start.outputs.is_empty());
        self.watch = (!self.start.outputs.is_empty()).then(|| self.start.demand.watch());
        self.news.tell(Update::Outputs(self.start.outputs.clone()));
    }

    /// Tells that there is no running source; `source` says why. Recordings are over; a virtual camera goes on with the
    /// next source.
    fn without_source(&mut self, source: Source) {
        // Before the first run, the recordings that were asked for at the start still wait for a source.
        if self.began {
            self.start.outputs.retain(|output| output.is_camera);
        }
        self.tell_outputs();
        self.news.tell(Update::Source(source));
    }

    /// Opens the source and starts a run of it.
    fn open(&mut self) {
        self.news.tell(Update::Source(Source::Opening));
        let opened = match self.start.services.open(&self.start.source, self.way) {
            Ok(opened) => opened,
            Err(line) => return self.without_source(Source::Lost(line)),
        };
        self.start.source.clone_from(&opened.name);
        self.tell_choices();
        self.news.tell(Update::Camera(opened.camera.clone()));
        self.news.tell(Update::Controls(opened.controls.clone()));
        opened.notes.iter().for_each(|line| self.news.note(line));
        self.runs += 1;
        self.start.wanted.need(!self.start.outputs.is_empty());
        let (orders, run) = (self.orders.clone(), self.runs);
        let to_host = orders.clone();
        let wrote = move |written| {
            let _ = to_host.send(Order::Wrote(run, written));
        };
        let ended = move |ended| {
            let _ = orders.send(Order::Ended(run, Box::new(ended)));
        };
        match Live::begin(opened, &mut self.start, &self.news, wrote, ended) {
            Ok((live, source)) => {
                self.looks = VecDeque::from([(0, live.effective(&self.start.look))]);
                self.live = Some(live);
                self.news.tell(Update::Source(source));
                // A recording ends with its source; a virtual camera goes on with the next one.
                let first = !std::mem::replace(&mut self.began, true);
                let outputs = std::mem::take(&mut self.start.outputs);
                outputs.into_iter().filter(|output| output.is_camera || first).for_each(|output| self.write_to(output));
                self.tell_outputs();
            }
            Err(line) => self.without_source(Source::Lost(line)),
        }
    }

    /// Opens an output and adds it to the run; a recording without a name is given one.
    fn write_to(&mut self, mut output: Output) {
        let Some(live) = &self.live else { return self.news.note("There is no source to write out.") };
        if output.name.is_empty() {
            output.name = self.free_name().display().to_string();
        }
        match self.start.services.output(&output.name, live.size, live.period_ns, &live.stop) {
            Ok(sink) => {
                self.start.wanted.need(true);
                live.write_to(&output, sink);
                self.start.outputs.push(output);
            }
            Err(line) => self.news.note(line),
        }
    }

    /// A path for a recording that does not exist yet.
    fn free_name(&self) -> PathBuf {
        // What is being written gets its name at the end.
        self.start
            .folders
            .free_video(|path| self.start.outputs.iter().any(|output| path.as_os_str() == output.name.as_str()))
    }

    /// Puts the command line that does the same on the clipboard.
    fn copy(&self, switches: &[Switch]) {
        // What is recorded now is there already: the command makes another one.
        let again = |output: &Output| match output.is_camera {
            true => output.name.clone(),
            false => self.free_name().display().to_string(),
        };
        let outputs: Vec<String> = self.start.outputs.iter().map(again).collect();
        let look = self.effective_look();
        let command = self.start.services.command(&look, &self.start.source, &outputs, switches);
        self.news.note(format!("Copied: {command}"));
        self.news.send(SessionEvent::Copy(command));
    }

    /// Takes note of what became of an output of the run of this number.
    fn on_output(&mut self, run: u64, Notice { member, fate }: &Notice) {
        match fate {
            Fate::Began => self.news.note(match camera_of(member) {
                Some(camera) => format!("Calls have this picture now: choose the camera {camera}"),
                None => format!("Recording to {}", folders::shown_output(member)),
            }),
            // What calls were shown is in no file.
            Fate::Completed { .. } if camera_of(member).is_some() => {}
            Fate::Completed { frames } => {
                self.news.note(format!("Complete: {}, {frames} frames", folders::shown_output(member)));
                self.news.kept(Path::new(member));
            }
            Fate::Failed { why, .. } => {
                tracing::error!("{why}");
                self.failed.get_or_insert_with(|| why.clone());
                self.news.tell(Update::Trouble(why.clone()));
                // The output of an earlier run may share its name with one of the present run.
                if run == self.runs {
                    self.start.outputs.retain(|output| output.name != *member);
                    self.tell_outputs();
                }
            }
        }
    }

    /// Keeps the report of a run that ended. If it was not stopped by the session, there is no source any more.
    fn on_run_end(&mut self, run: u64, ended: Result<Report, PipelineError>) {
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
            self.without_source(source);
        }
    }

    /// Ends the run, if there is one, and completes what it wrote.
    fn stop(&mut self) {
        self.report = self.live.take().and_then(Live::stop).or_else(|| self.report.take());
    }
}

/// What calls call an output, where it is a camera.
fn camera_of(output: &str) -> Option<String> {
    let target: Target = output.parse().ok().filter(Target::is_camera)?;
    Some(match target {
        Target::PipeWire(label) => label.unwrap_or_else(|| "bokehcam".to_owned()),
        other => other.to_string(),
    })
}

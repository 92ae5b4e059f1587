//! What others ask of the window from outside.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::Instant;

use winit::event_loop::{ActiveEventLoop, EventLoopProxy};

use super::App;
use crate::control::{Asked, Control, Judge, Wish};
use crate::lent::Lent;
use crate::session::{CurrentRelease, StillOrder};
use crate::state::{Action, Source, Way};
use crate::window::Call;
use bokehcam::control::{Answer, Server, Status};
use bokehcam::look::{Look, Patch};

/// Listens to those who ask, until it is dropped.
pub(super) struct Controlled {
    server: Server,
    asked: Receiver<Asked>,
    began: Instant,
    judge: Box<Judge>,
    /// What of the look is not the person's own.
    lent: Lent,
    /// A snapshot that waits for its frame.
    order: Option<StillOrder>,
}

impl Controlled {
    pub fn begin(control: Control, release: CurrentRelease, proxy: &EventLoopProxy<Call>) -> std::io::Result<Self> {
        let proxy = proxy.clone();
        // An event loop that is gone needs no waking.
        let (server, asked, judge) = control.begin(release, move || drop(proxy.send_event(Call::Control)))?;
        Ok(Self { server, asked, began: Instant::now(), judge, lent: Lent::default(), order: None })
    }

    /// The snapshot that was asked for from outside, for who saves it.
    pub fn take_order(&mut self) -> Option<StillOrder> {
        self.order.take()
    }
}

impl App {
    /// Does what others ask for, as if the person had done it here.
    pub(super) fn listen(&mut self, events: &ActiveEventLoop) {
        while let Some(Asked { wish, answer }) = self.controlled.as_ref().and_then(|all| all.asked.try_recv().ok()) {
            let done = match wish {
                Wish::Status => Ok(None),
                Wish::On(on) => {
                    self.perform(Action::Off(!on), events);
                    Ok(None)
                }
                Wish::Toggle => {
                    self.perform(Action::Off(!self.state.off), events);
                    Ok(None)
                }
                Wish::Look(patch) => self.look_after(&patch).map(|(look, note)| {
                    let before = self.state.chosen_look();
                    self.perform(Action::Look { look: Box::new(look), stroke: None }, events);
                    let after = self.state.chosen_look();
                    self.controlled.iter_mut().for_each(|all| all.lent.change(&before, &after));
                    note
                }),
                Wish::Depth(way) => self.can_make_depth_by(way).map(|()| {
                    self.perform(Action::DepthBy(way), events);
                    None
                }),
                Wish::Snapshot(to) => {
                    self.snapshot_for(to, answer);
                    continue;
                }
            };
            let told = match (done, self.status()) {
                (Err(answer), _) => answer,
                (Ok(note), Some(status)) => Answer::Done { status: Box::new(status), note },
                (Ok(_), None) => Answer::failed("the window is closed"),
            };
            // Whoever gave up waiting needs no answer.
            let _ = answer.try_send(told);
        }
    }

    /// The look after a change, if it can be, and what of the change has no effect.
    fn look_after(&self, patch: &Patch) -> Result<(Look, Option<String>), Answer> {
        let look = self.state.patched(patch).map_err(Answer::usage);
        let note = match (&self.state.source, &self.controlled) {
            (Source::Running(running), Some(all)) => (all.judge)(patch, &self.state.look, running)?,
            _ => None,
        };
        Ok((look?, note))
    }

    /// Refuses a way to depth that the source has not; the answer names those that it has.
    fn can_make_depth_by(&self, way: Way) -> Result<(), Answer> {
        let ways = self.state.ways();
        if ways.contains(&way) {
            return Ok(());
        }
        let there = match ways {
            [] => "it has none".to_owned(),
            ways => format!("use {}", ways.iter().map(Way::to_string).collect::<Vec<_>>().join(", ")),
        };
        Err(Answer::usage(format!("this source has no depth by {way}: {there}")))
    }

    /// The look to be remembered: without what others have lent it.
    pub(super) fn own_look(&self) -> Look {
        let look = self.state.chosen_look();
        self.controlled.as_ref().map_or_else(|| look.clone(), |all| all.lent.without(&look))
    }

    /// Saves the frame that is shown for somebody who waits for that.
    fn snapshot_for(&mut self, to: Option<PathBuf>, answer: SyncSender<Answer>) {
        let refused = match (&self.view, &to) {
            _ if self.state.off => Some("it is off: there is no picture"),
            (None, _) => Some("there is no picture yet"),
            (_, Some(path)) if !path.is_absolute() => Some("say the whole path of the file"),
            _ => None,
        };
        match (refused, &mut self.controlled) {
            (Some(why), _) => drop(answer.try_send(Answer::failed(why))),
            (None, Some(controlled)) => {
                controlled.order = Some(StillOrder { to, answer });
                self.snapshot();
            }
            (None, None) => {}
        }
    }

    /// Lets no picture pass, to the screen neither, or lets them again.
    pub(super) fn switch_off(&mut self, off: bool) {
        self.off.store(off, Ordering::Release);
        self.heard_at = Instant::now();
        if off {
            (self.view, self.held, self.snapshot_due) = (None, None, false);
            self.session.let_go();
        }
    }

    fn status(&self) -> Option<Status> {
        let controlled = self.controlled.as_ref()?;
        let state = &self.state;
        let size = match &state.source {
            Source::Running(running) => Some(running.size),
            _ => None,
        };
        let outputs = state.outputs.iter().map(|output| output.name.clone());
        let is_moving =
            size.is_some() && !state.off && !state.frozen && state.silent_s.is_none() && self.watch.is_some();
        let round = |value: f64| (value * 10.0).round() / 10.0;
        Some(Status {
            name: controlled.server.name().to_string(),
            pid: std::process::id(),
            command: "preview".into(),
            on: !state.off,
            source: state.source_name.clone(),
            size,
            depth: self.state.way().map(|way| way.to_string()),
            sinks: ["window".to_owned()].into_iter().chain(outputs).collect(),
            watched: Some(self.demand.has_watchers()),
            quality: self.view.as_ref().and_then(|view| Some(view.trace.quality?.name().to_owned())),
            fps: if is_moving { round(state.meters.summary().fps) } else { 0.0 },
            look: Patch::described(&state.look),
            uptime_s: round(controlled.began.elapsed().as_secs_f64()),
        })
    }
}

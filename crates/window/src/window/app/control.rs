//! What others ask of the window from outside: its own thread does it, as if the person had done it here.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use winit::event_loop::{ActiveEventLoop, EventLoopProxy};

use super::App;
use crate::lent::Lent;
use crate::session::{CurrentRelease, StillOrder};
use crate::state::{Action, Running, Source, Way};
use crate::window::{Call, Control};
use bokehcam::control::{Answer, Server, Status};
use bokehcam::controller::{Controlled, Controller, Facts, Rules};
use bokehcam::look::{Look, Patch};
use bokehcam::sink::Release;
use bokehcam::source::DepthChoice;

/// How long the window, and who saves pictures, may take to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// Something that the window's thread is to do for somebody else.
type Errand = Box<dyn FnOnce(&mut App, &ActiveEventLoop) + Send>;

/// The window as those see it who control it.
struct Remote {
    errands: Sender<Errand>,
    proxy: EventLoopProxy<Call>,
    release: CurrentRelease,
}

/// Listens to those who ask, until it is dropped.
pub(super) struct Served {
    /// Gone first, so that nobody waits for what is not done any more.
    errands: Receiver<Errand>,
    _server: Server,
    /// What of the look is not the person's own.
    lent: Lent,
    /// A snapshot that waits for its frame.
    order: Option<StillOrder>,
}

impl Served {
    pub fn begin(
        Control { claim, rules }: Control,
        release: CurrentRelease,
        proxy: &EventLoopProxy<Call>,
    ) -> std::io::Result<Self> {
        let (to, errands) = mpsc::channel();
        let remote = Remote { errands: to, proxy: proxy.clone(), release };
        let handler = Controller::begin(claim.name().clone(), "preview", rules, remote);
        Ok(Self { errands, _server: claim.serve(handler)?, lent: Lent::default(), order: None })
    }

    /// The snapshot that was asked for from outside, for who saves it.
    pub fn take_order(&mut self) -> Option<StillOrder> {
        self.order.take()
    }
}

impl Remote {
    /// Has the window's thread do this.
    fn ask<T: Send + 'static>(
        &self,
        what: impl FnOnce(&mut App, &ActiveEventLoop) -> T + Send + 'static,
    ) -> Result<T, Answer> {
        let (to, done) = mpsc::sync_channel(1);
        // Whoever gave up waiting needs no answer.
        let errand: Errand = Box::new(move |app, events| drop(to.try_send(what(app, events))));
        self.errands.send(errand).map_err(|_| Answer::failed("the window is closed"))?;
        // An event loop that is gone needs no waking.
        let _ = self.proxy.send_event(Call::Control);
        taken(&done)
    }
}

/// What somebody else gives, in time.
fn taken<T>(from: &Receiver<T>) -> Result<T, Answer> {
    from.recv_timeout(PATIENCE).map_err(|_| Answer::failed("the window does not answer in time"))
}

impl Controlled for Remote {
    fn status(&self) -> Result<Status, Answer> {
        self.ask(|app, _| app.status())
    }

    fn switch(&self, on: Option<bool>) -> Result<bool, Answer> {
        self.ask(move |app, events| {
            let on = on.unwrap_or(app.state.off);
            app.perform(Action::Off(!on), events);
            on
        })
    }

    fn release(&self) -> Option<Release> {
        self.release.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn change(&self, patch: Patch, rules: &Arc<dyn Rules>) -> Result<Option<String>, Answer> {
        let rules = Arc::clone(rules);
        self.ask(move |app, events| app.change(&patch, &*rules, events))?
    }

    fn make_depth_by(&self, way: &str) -> Result<(), Answer> {
        let way = way.parse().map_err(Answer::usage)?;
        self.ask(move |app, events| {
            app.can_make_depth_by(way)?;
            app.perform(Action::DepthBy(way), events);
            Ok(())
        })?
    }

    fn save(&self, to: Option<&Path>) -> Result<PathBuf, Answer> {
        let to = to.map(Path::to_owned);
        let (answer, saved) = mpsc::sync_channel(1);
        self.ask(move |app, _| app.snapshot_for(to, answer))??;
        taken(&saved)?
    }
}

impl App {
    /// Does what others ask for.
    pub(super) fn listen(&mut self, events: &ActiveEventLoop) {
        while let Some(errand) = self.served.as_ref().and_then(|served| served.errands.try_recv().ok()) {
            errand(self, events);
        }
    }

    /// Changes the look for others, who lend it; gives back what of the change has no effect.
    fn change(
        &mut self,
        patch: &Patch,
        rules: &dyn Rules,
        events: &ActiveEventLoop,
    ) -> Result<Option<String>, Answer> {
        let note = match &self.state.source {
            Source::Running(running) => rules.changed(patch, &self.state.look, &facts(running))?.1,
            _ => None,
        };
        let look = self.state.patched(patch).map_err(Answer::usage)?;
        let before = self.state.chosen_look();
        self.perform(Action::Look { look: Box::new(look), stroke: None }, events);
        let after = self.state.chosen_look();
        self.served.iter_mut().for_each(|served| served.lent.change(&before, &after));
        Ok(note)
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
        self.served.as_ref().map_or_else(|| look.clone(), |served| served.lent.without(&look))
    }

    /// Saves the frame that is shown for somebody who waits for that.
    fn snapshot_for(
        &mut self,
        to: Option<PathBuf>,
        answer: SyncSender<Result<PathBuf, Answer>>,
    ) -> Result<(), Answer> {
        if self.view.is_none() {
            return Err(Answer::failed("there is no picture yet"));
        }
        if let Some(served) = &mut self.served {
            served.order = Some(StillOrder { to, answer });
            self.snapshot();
        }
        Ok(())
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
            depth: state.way().map(|way| way.to_string()),
            sinks: ["window".to_owned()].into_iter().chain(outputs).collect(),
            watched: Some(self.demand.has_watchers()),
            quality: self.view.as_ref().and_then(|view| Some(view.trace.quality?.name().to_owned())),
            fps: if is_moving { state.meters.summary().fps } else { 0.0 },
            look: Patch::described(&state.look),
            ..Status::default()
        }
    }
}

/// What decides which looks a source can have. Depth that was declined is none of it.
fn facts(&Running { kind, size, has_depth, depth_from, .. }: &Running) -> Facts {
    Facts { kind, size, has_depth, depth_from, depth_choice: DepthChoice::Auto }
}

//! The window's events.

mod show;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::WindowId;

use super::gfx::Gfx;
use super::memory::Memory;
use super::{Ended, Preview, WindowError};
use crate::bokeh;
use crate::clock::Clock;
use crate::compute::device::Device;
use crate::frame::ColorImage;
use crate::link::Receiver;
use crate::optics::CocField;
use crate::pipeline::{View, Wanted};
use crate::preview::meters::Totals;
use crate::preview::panel::Panel;
use crate::preview::session::{Closed, Session, SessionEvent, Wake};
use crate::preview::state::{Shown, Source, State};
use crate::preview::views::Views;
use crate::stats::WindowUse;

/// Instruments are laid out anew this often.
const INSTRUMENTS_PERIOD: Duration = Duration::from_millis(200);
/// A stop from outside is seen after this time at the latest.
const LOOK_UP: Duration = Duration::from_millis(250);
/// After so long without a frame, and so many periods of the source, the person is told.
const SILENCE: Duration = Duration::from_secs(2);
const SILENT_PERIODS: u32 = 10;
/// What a picture is like of which nothing is known yet.
const USUAL_SIZE: (u32, u32) = (1280, 720);

pub(super) struct App {
    state: State,
    wanted: Arc<Wanted>,
    /// A snapshot waits for a frame that is in memory.
    snapshot_due: bool,
    panel: Panel,
    ctx: egui::Context,
    gfx: Option<Gfx>,
    device: Option<Arc<Device>>,
    session: Session,
    /// Whether a wake is under way, so that a busy session rings once.
    rung: Arc<AtomicBool>,
    views: Option<Receiver<View>>,
    view: Option<View>,
    /// Whether `view` was not on the screen yet.
    view_is_new: bool,
    made: Views,
    /// What `made` shows.
    drawn: Shown,
    /// What the frames that come are blurred with.
    settings: Option<bokeh::Settings>,
    nothing: ColorImage,
    clock: Clock,
    /// When the last frame came, or its source was opened.
    heard_at: Instant,
    /// When controls are to be laid out next.
    layout_at: Option<Instant>,
    laid_out: Instant,
    /// The oldest input whose effect is not on the screen yet.
    input_at: Option<Instant>,
    /// Whether nothing of the window is to be seen, and whether it has no pixels.
    covered: bool,
    empty: bool,
    memory: Option<PathBuf>,
    remembered: Option<Memory>,
    close_at_end: bool,
    stop: Arc<AtomicBool>,
    failed: Option<WindowError>,
}

impl App {
    /// Begins the session at once, so that the source opens while the window does.
    pub fn new(preview: Preview, proxy: EventLoopProxy<()>) -> Result<Self, WindowError> {
        let Preview { mut state, session, device, close_at_end, memory, stop } = preview;
        let rung = Arc::new(AtomicBool::new(false));
        let ringing = Arc::clone(&rung);
        // An event loop that is gone needs no waking.
        let wake: Wake = Arc::new(move || {
            if !ringing.swap(true, Ordering::AcqRel) {
                let _ = proxy.send_event(());
            }
        });
        let wanted = Arc::clone(&session.wanted);
        let clock = Clock::system();
        state.meters.begin(clock.now_ns());
        let ctx = egui::Context::default();
        let remembered = memory.as_deref().and_then(Memory::read);
        Ok(Self {
            state,
            wanted,
            snapshot_due: false,
            panel: Panel::default(),
            ctx,
            gfx: None,
            device,
            session: Session::begin(session, wake)?,
            rung,
            views: None,
            view: None,
            view_is_new: false,
            made: Views::default(),
            drawn: Shown::default(),
            settings: None,
            nothing: ColorImage::new(16, 9),
            clock,
            heard_at: Instant::now(),
            layout_at: Some(Instant::now()),
            laid_out: Instant::now(),
            input_at: None,
            covered: false,
            empty: false,
            memory,
            remembered,
            close_at_end,
            stop,
            failed: None,
        })
    }

    /// Closes the session after the window. What was shown last goes into the report.
    pub fn end(self) -> Result<Ended, WindowError> {
        let Self { gfx, view, views, session, state, failed, .. } = self;
        // The window goes at once; outputs may take a while to be completed.
        drop((gfx, view));
        let Closed { mut report, failed: unwritten } = session.close();
        // Only now: the frames on the way to a viewer that is gone would be nobody's.
        drop(views);
        if let Some(report) = &mut report {
            report.window = Some(window_use(&state));
        }
        let lost = match state.source {
            Source::Lost(why) => Some(why),
            _ => None,
        };
        failed.map_or(Ok(Ended { report, lost, unwritten }), Err)
    }

    /// Hears what the session has to say, and takes the newest frame.
    fn hear(&mut self, events: &ActiveEventLoop) {
        // Before the look: what comes after it rings again.
        self.rung.swap(false, Ordering::AcqRel);
        let mut changed = false;
        while let Some(heard) = self.session.hear() {
            match heard {
                SessionEvent::Views(views) => {
                    self.heard_at = Instant::now();
                    // It was of another source.
                    self.snapshot_due = false;
                    self.views = Some(views);
                    self.state.meters.restart();
                }
                SessionEvent::Copy(text) => {
                    if let Some(gfx) = &mut self.gfx {
                        gfx.input.set_clipboard_text(text);
                    }
                }
                SessionEvent::Update(told) => {
                    if let Some(look) = self.state.hear(told) {
                        self.session.order(look);
                    }
                    changed = true;
                }
            }
        }
        if changed {
            self.look_changed();
            self.layout_at = Some(Instant::now());
            self.place();
            self.set_title();
            if self.close_at_end && matches!(self.state.source, Source::Ended | Source::Lost(_)) {
                events.exit();
            }
        }
        let newest = self.views.as_mut().and_then(Receiver::try_recv);
        if newest.is_some() {
            self.heard_at = Instant::now();
            self.listen();
        }
        let frozen = self.state.frozen && self.view.as_ref().is_some_and(|view| view.picture.memory().is_some());
        if let Some(view) = newest.filter(|_| !frozen) {
            self.state.focus_m = match view.coc {
                CocField::Depth(coc) => Some(coc.focus_m),
                _ => None,
            };
            self.view = Some(view);
            self.view_is_new = true;
            changed = true;
            if self.snapshot_due {
                self.snapshot();
            }
        }
        if changed {
            self.ask_for_redraw();
        }
    }

    /// Whether frames come. A camera that is gone may come back by itself: only its silence tells.
    fn listen(&mut self) {
        let silent = match &self.state.source {
            Source::Running(running) => {
                let patience = SILENCE.max(Duration::from_nanos(running.period_ns) * SILENT_PERIODS);
                Some(self.heard_at.elapsed()).filter(|silent| *silent > patience)
            }
            _ => None,
        };
        let silent_s = silent.map(|silent| silent.as_secs());
        if std::mem::replace(&mut self.state.silent_s, silent_s) != silent_s {
            self.layout_at = Some(Instant::now());
            self.ask_for_redraw();
        }
    }

    fn set_title(&self) {
        if let (Some(gfx), Source::Running(running)) = (&self.gfx, &self.state.source) {
            gfx.window.set_title(&format!("{} - bokehcam", running.label));
        }
    }

    fn look_changed(&mut self) {
        self.settings = match &self.state.source {
            Source::Running(running) => self.state.look.for_source(running.has_depth).settings(running.size, true),
            _ => None,
        };
    }

    fn ask_for_redraw(&self) {
        if let Some(gfx) = self.gfx.as_ref().filter(|_| !self.is_hidden()) {
            gfx.window.request_redraw();
        }
    }

    fn is_hidden(&self) -> bool {
        self.covered || self.empty
    }

    fn touched(&mut self) {
        let now = Instant::now();
        if !self.is_hidden() {
            self.input_at.get_or_insert(now);
        }
        self.layout_at = Some(now);
        self.ask_for_redraw();
    }

    fn picture_size(&self) -> (u32, u32) {
        match (&self.view, &self.state.source) {
            (Some(view), _) => view.picture.size(),
            (None, Source::Running(running)) => running.size,
            (None, _) => USUAL_SIZE,
        }
    }
}

fn window_use(state: &State) -> WindowUse {
    let Totals { presented, first_frame_ns, latency, reaction, present } = state.meters.totals();
    WindowUse::new(*presented, *first_frame_ns, [latency, reaction, present])
}

impl ApplicationHandler<()> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.gfx.is_some() {
            return;
        }
        match Gfx::open(events, &self.ctx, self.remembered, self.state.full_screen, self.device.clone()) {
            Ok(gfx) => {
                self.gfx = Some(gfx);
                self.place();
            }
            Err(error) => {
                self.failed = Some(error);
                return events.exit();
            }
        }
        self.hear(events);
        self.ask_for_redraw();
    }

    fn user_event(&mut self, events: &ActiveEventLoop, (): ()) {
        self.hear(events);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(gfx) = &mut self.gfx else { return };
        match &event {
            WindowEvent::RedrawRequested => {
                let due = self.state.instruments && self.view_is_new && self.laid_out.elapsed() >= INSTRUMENTS_PERIOD;
                if due || self.layout_at.is_some_and(|at| at <= Instant::now()) {
                    self.lay_out(events);
                }
                return self.draw(events);
            }
            WindowEvent::CloseRequested => return events.exit(),
            WindowEvent::Occluded(hidden) => {
                self.covered = *hidden;
                // What waits while nobody can see it is no latency.
                self.input_at = None;
                return self.ask_for_redraw();
            }
            WindowEvent::Resized(size) => {
                gfx.presenter.resize((size.width, size.height));
                self.empty = size.width == 0 || size.height == 0;
                self.remembered = gfx.memory().or(self.remembered);
            }
            _ => {}
        }
        if gfx.input.on_window_event(&gfx.window, &event).repaint {
            self.touched();
        }
        // What is pressed is found by where the pointer is when controls are laid out: not after it has moved on.
        if matches!(event, WindowEvent::MouseInput { .. }) {
            self.lay_out(events);
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if self.stop.load(Ordering::Relaxed) {
            return events.exit();
        }
        self.listen();
        let now = Instant::now();
        if self.layout_at.is_some_and(|at| at <= now) {
            self.ask_for_redraw();
        }
        // What is due waits for the redraw that was asked for, which the display may hold back.
        let layout_at = self.layout_at.filter(|at| !self.is_hidden() && *at > now);
        let layout_at = layout_at.map_or(now + LOOK_UP, |at| at.min(now + LOOK_UP));
        events.set_control_flow(ControlFlow::WaitUntil(layout_at));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        if let (Some(path), Some(memory)) = (&self.memory, self.gfx.as_ref().and_then(Gfx::memory).or(self.remembered))
        {
            memory.write(path);
        }
    }
}

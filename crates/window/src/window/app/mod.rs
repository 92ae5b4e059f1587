//! The window as `winit` runs it: receives the events, updates the state and draws.

mod control;
mod dropped_files;
mod held_frame;
mod meters;
mod receive;
mod render;
mod seek;
mod user_events;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::event::{TouchPhase, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::WindowId;

use super::gfx::Gfx;
use super::saved_state::SavedState;
use super::{Preview, PreviewOutcome, UserEvent, WindowError};
use crate::panel::{Panel, SystemFonts};
use crate::session::{Session, SessionOutcome, Wake};
use crate::state::{Action, Source, State};
use crate::views::DepthView;
use bokehcam::clock::Clock;
use bokehcam::compute::device::Device;
use bokehcam::depth::plate::Guide;
use bokehcam::frame::ColorImage;
use bokehcam::link::Receiver;
use bokehcam::link::demand::{Demand, Watch};
use bokehcam_live::pipeline::{OutputRequest, View};

/// Maximum interval of polling the stop flag.
const STOP_POLL: Duration = Duration::from_millis(250);

pub(super) struct App {
    state: State,
    output_request: Arc<OutputRequest>,
    /// Whether a snapshot waits for a frame that can be saved.
    snapshot_due: bool,
    panel: Panel,
    ctx: egui::Context,
    fonts: SystemFonts,
    proxy: EventLoopProxy<UserEvent>,
    gfx: Option<Gfx>,
    device: Option<Arc<Device>>,
    session: Session,
    /// Whether a wake-up is pending, so that a busy session does not flood the event queue.
    wake_pending: Arc<AtomicBool>,
    frames: Option<Receiver<View>>,
    /// Progress of the background plate, if depth comes from it.
    guide: Option<Arc<Guide>>,
    seek_state: seek::SeekState,
    view: Option<View>,
    /// Whether `view` has not been displayed yet.
    view_is_new: bool,
    depth_view: DepthView,
    /// Whether `depth_view` drew the depth of `view`.
    is_depth_drawn: bool,
    /// Number of the held frame, and the highest number so far.
    held_number: Option<u64>,
    last_still_number: u64,
    /// Keeps the source running.
    watch: Option<Watch>,
    demand: Demand,
    blank_picture: ColorImage,
    /// The still card, shown while the picture is off.
    card: ColorImage,
    clock: Clock,
    meters: meters::Meters,
    /// Time of the last frame, or of opening its source.
    last_frame_at: Instant,
    /// Time of the next layout of the controls, and of the last one.
    layout_at: Option<Instant>,
    laid_out_at: Instant,
    /// Time of the oldest input whose effect is not displayed yet.
    input_at: Option<Instant>,
    /// Whether a path was dropped in this event batch: files of one drop arrive one after the other.
    has_dropped: bool,
    /// Whether the window is fully covered; `has_zero_size` is whether it has zero size.
    covered: bool,
    /// Time since which the window is invisible.
    hidden_at: Option<Instant>,
    has_zero_size: bool,
    /// Persistent state of the window, and its file.
    saved_state: SavedState,
    saved_state_file: Option<PathBuf>,
    close_at_end: bool,
    /// Remote control, if it is enabled.
    remote_control: Option<control::RemoteControl>,
    /// Whether outputs get the still card; shared with the session.
    off: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    failed: Option<WindowError>,
}

impl App {
    /// Starts the session immediately, so that the source opens in parallel with the window.
    pub fn new(preview: Preview, proxy: EventLoopProxy<UserEvent>) -> Result<Self, WindowError> {
        let Preview { state, session, theme, device, close_at_end, saved_state, saved_state_file, control, stop } =
            preview;
        let wake_pending = Arc::new(AtomicBool::new(false));
        let wake = create_wake(Arc::clone(&wake_pending), proxy.clone());
        let off = Arc::clone(&session.off);
        let (output_request, demand) = (Arc::clone(&session.output_request), session.demand.clone());
        let session = Session::start(session, wake)?;
        let control = control.inspect_err(|why| tracing::warn!("{why}")).ok();
        let start = |control| control::RemoteControl::start(control, session.shutter(), &proxy);
        let remote_control = control.map(start).transpose()?;
        let clock = Clock::system();
        let ctx = egui::Context::default();
        let fonts = user_events::init_appearance(&ctx, theme, &proxy);
        Ok(Self {
            state,
            output_request,
            snapshot_due: false,
            panel: Panel::default(),
            ctx,
            fonts,
            proxy,
            gfx: None,
            device,
            session,
            wake_pending,
            frames: None,
            guide: None,
            seek_state: seek::SeekState::default(),
            view: None,
            view_is_new: false,
            depth_view: DepthView::default(),
            is_depth_drawn: false,
            held_number: None,
            last_still_number: 0,
            watch: Some(demand.watch()),
            demand,
            blank_picture: ColorImage::new(16, 9),
            card: ColorImage::new(0, 0),
            meters: meters::Meters::new(clock.now_ns()),
            clock,
            last_frame_at: Instant::now(),
            layout_at: Some(Instant::now()),
            laid_out_at: Instant::now(),
            input_at: None,
            has_dropped: false,
            covered: false,
            hidden_at: None,
            has_zero_size: false,
            saved_state,
            saved_state_file,
            close_at_end,
            remote_control,
            off,
            stop,
            failed: None,
        })
    }

    /// Closes the window and then the session, and adds display statistics to the report.
    pub fn finish(self) -> Result<PreviewOutcome, WindowError> {
        let Self { gfx, view, frames, session, state, meters, failed, remote_control, .. } = self;
        // Stops remote control first.
        drop(remote_control);
        // Closes the window immediately; completing the outputs may take a while.
        drop((gfx, view));
        let SessionOutcome { mut report, output_error } = session.close();
        // Only after the session: without a receiver, the last frames would be counted as neither delivered nor
        // dropped.
        drop(frames);
        if let Some(report) = &mut report {
            report.window = Some(meters.stats());
        }
        let source_error = match state.source {
            Source::Lost(why) => Some(why),
            _ => None,
        };
        failed.map_or(Ok(PreviewOutcome { report, source_error, output_error }), Err)
    }

    fn set_title(&self) {
        if let (Some(gfx), Source::Running(_)) = (&self.gfx, &self.state.source) {
            gfx.window.set_title(&format!("{} - bokehcam", self.state.title()));
        }
    }

    fn on_input(&mut self) {
        let now = Instant::now();
        if !self.is_hidden() {
            self.input_at.get_or_insert(now);
        }
        self.layout_at = Some(now);
        self.request_redraw();
    }
}

/// Returns a function that wakes the event loop unless a wake-up is `pending` already.
fn create_wake(pending: Arc<AtomicBool>, proxy: EventLoopProxy<UserEvent>) -> Wake {
    Arc::new(move || {
        if !pending.swap(true, Ordering::AcqRel) {
            // Fails only if the event loop has ended.
            let _ = proxy.send_event(UserEvent::Session);
        }
    })
}

impl ApplicationHandler<UserEvent> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.gfx.is_some() {
            return;
        }
        match Gfx::open(events, &self.ctx, self.saved_state.size, self.state.full_screen, self.device.clone()) {
            Ok(mut gfx) => {
                gfx.input.init_accesskit(events, &gfx.window, self.proxy.clone());
                self.gfx = Some(gfx);
                self.update_output_request();
            }
            Err(error) => {
                self.failed = Some(error);
                return events.exit();
            }
        }
        self.process_session(events);
        self.request_redraw();
    }

    fn user_event(&mut self, events: &ActiveEventLoop, call: UserEvent) {
        self.handle_user_event(call, events);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(gfx) = &mut self.gfx else { return };
        match &event {
            WindowEvent::RedrawRequested => {
                if self.layout_at.is_some_and(|at| at <= Instant::now()) {
                    self.lay_out(events);
                }
                return self.draw(events);
            }
            WindowEvent::CloseRequested => {
                self.perform_action(Action::Close, events);
                return self.on_input();
            }
            WindowEvent::DroppedFile(path) => return self.on_file_dropped(path, events),
            WindowEvent::Occluded(hidden) => {
                self.covered = *hidden;
                // Time while the window is invisible does not count as latency.
                self.input_at = None;
                return self.request_redraw();
            }
            WindowEvent::Resized(size) => {
                gfx.presenter.resize((size.width, size.height));
                self.has_zero_size = size.width == 0 || size.height == 0;
                self.saved_state.size = gfx.size_to_save().or(self.saved_state.size);
            }
            _ => {}
        }
        if gfx.input.on_window_event(&gfx.window, &event).repaint {
            self.on_input();
        }
        // egui locates a press at the pointer's position during layout, so lay out before the pointer moves on.
        let is_press = match &event {
            WindowEvent::Touch(touch) => touch.phase != TouchPhase::Moved,
            other => matches!(other, WindowEvent::MouseInput { .. }),
        };
        if is_press {
            self.lay_out(events);
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        self.has_dropped = false;
        if self.stop.load(Ordering::Relaxed) {
            return events.exit();
        }
        self.update_watch();
        self.update_silence();
        let now = Instant::now();
        if self.layout_at.is_some_and(|at| at <= now) {
            self.request_redraw();
        }
        // A layout that is already due needs no timer: it waits for its redraw, which the display may throttle.
        let layout_at = self.layout_at.filter(|at| !self.is_hidden() && *at > now);
        let layout_at = layout_at.map_or(now + STOP_POLL, |at| at.min(now + STOP_POLL));
        events.set_control_flow(ControlFlow::WaitUntil(layout_at));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        let Some(path) = &self.saved_state_file else { return };
        self.saved_state.size = self.gfx.as_ref().and_then(Gfx::size_to_save).or(self.saved_state.size);
        self.saved_state.preferences = self.state.preferences.clone();
        self.state.chosen_source.iter().for_each(|name| self.saved_state.set_source(name));
        self.saved_state.set_look(&self.look_to_save());
        self.saved_state.write(path);
    }
}

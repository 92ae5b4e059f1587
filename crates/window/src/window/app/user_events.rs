//! User events of the event loop: from the session, remote control, screen readers, the desktop's theme, and fonts.

use std::time::Instant;

use egui_winit::accesskit_winit::WindowEvent as AccessibilityEvent;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};

use super::App;
use super::held_frame::focus_distance_m;
use crate::panel::SystemFonts;
use crate::window::{ThemeChoice, UserEvent, desktop};
use bokehcam_live::pipeline::View;

/// Sets the theme and the system fonts, and subscribes to their changes. Sends after the event loop has ended are
/// ignored.
pub(super) fn init_appearance(
    ctx: &egui::Context,
    theme: ThemeChoice,
    proxy: &EventLoopProxy<UserEvent>,
) -> SystemFonts {
    let to_fonts = proxy.clone();
    let fonts = SystemFonts::new(move || drop(to_fonts.send_event(UserEvent::Fonts)));
    fonts.install(ctx);
    // Dark until the desktop reports its theme, which may take long or never happen.
    ctx.set_theme(if theme == ThemeChoice::Light { egui::Theme::Light } else { egui::Theme::Dark });
    if theme == ThemeChoice::Auto {
        let to_theme = proxy.clone();
        desktop::watch_theme(move |theme| to_theme.send_event(UserEvent::Theme(theme)).is_ok());
    }
    fonts
}

impl App {
    /// Updates the state with a new frame's properties.
    pub(super) fn update_from_frame(&mut self, view: &View) {
        self.state.focus_m = focus_distance_m(&view.coc);
        let (is_transitional, crop) = (view.is_transitional, view.crop);
        if (self.state.is_transitional, self.state.crop) != (is_transitional, crop) {
            (self.state.is_transitional, self.state.crop) = (is_transitional, crop);
            self.layout_at = Some(Instant::now());
        }
    }

    /// Handles a user event, and schedules a layout of the controls.
    pub(super) fn handle_user_event(&mut self, call: UserEvent, events: &ActiveEventLoop) {
        match call {
            UserEvent::Session => return self.process_session(events),
            UserEvent::Control => self.run_remote_tasks(events),
            UserEvent::Accessibility(event) => match (event.window_event, &mut self.gfx) {
                (AccessibilityEvent::InitialTreeRequested, _) => {
                    self.panel.is_always_visible = true;
                    self.ctx.enable_accesskit();
                }
                (AccessibilityEvent::AccessibilityDeactivated, _) => {
                    self.panel.is_always_visible = false;
                    self.ctx.disable_accesskit();
                }
                (AccessibilityEvent::ActionRequested(request), Some(gfx)) => {
                    gfx.input.on_accesskit_action_request(request)
                }
                (AccessibilityEvent::ActionRequested(_), None) => {}
            },
            UserEvent::Theme(theme) => self.ctx.set_theme(theme),
            UserEvent::Fonts => self.fonts.install(&self.ctx),
        }
        self.layout_at = Some(Instant::now());
        self.request_redraw();
    }
}

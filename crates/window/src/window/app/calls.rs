//! What the window's thread is called for: the session, screen readers, the desktop's colours, fonts.

use std::time::Instant;

use egui_winit::accesskit_winit::WindowEvent as Access;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};

use super::App;
use super::hold::focus_m;
use crate::panel::SystemFonts;
use crate::window::{Call, ThemeChoice, desktop};
use bokehcam::pipeline::View;

/// Gives the controls their colours and the system's fonts, now and as soon as others are known. An event loop that is
/// gone need not know them.
pub(super) fn follow(ctx: &egui::Context, theme: ThemeChoice, proxy: &EventLoopProxy<Call>) -> SystemFonts {
    let to_fonts = proxy.clone();
    let fonts = SystemFonts::new(move || drop(to_fonts.send_event(Call::Fonts)));
    fonts.install(ctx);
    // Dark until the desktop says otherwise: it may take its time, or have nothing to say.
    ctx.set_theme(if theme == ThemeChoice::Light { egui::Theme::Light } else { egui::Theme::Dark });
    if theme == ThemeChoice::Auto {
        let to_theme = proxy.clone();
        desktop::follow(move |theme| to_theme.send_event(Call::Theme(theme)).is_ok());
    }
    fonts
}

impl App {
    /// Takes note of what the controls show of a frame.
    pub(super) fn learn_from(&mut self, view: &View) {
        self.state.focus_m = focus_m(&view.coc);
        let (between, part) = (view.is_between, view.part);
        if (self.state.between, self.state.part) != (between, part) {
            (self.state.between, self.state.part) = (between, part);
            self.layout_at = Some(Instant::now());
        }
    }

    /// Does what the thread was called for, and lays the controls out anew where they may have changed.
    pub(super) fn answer(&mut self, call: Call, events: &ActiveEventLoop) {
        match call {
            Call::Session => return self.receive(events),
            Call::Control => self.listen(events),
            Call::Access(event) => match (event.window_event, &mut self.gfx) {
                (Access::InitialTreeRequested, _) => {
                    self.panel.stays = true;
                    self.ctx.enable_accesskit();
                }
                (Access::AccessibilityDeactivated, _) => {
                    self.panel.stays = false;
                    self.ctx.disable_accesskit();
                }
                (Access::ActionRequested(request), Some(gfx)) => gfx.input.on_accesskit_action_request(request),
                (Access::ActionRequested(_), None) => {}
            },
            Call::Theme(theme) => self.ctx.set_theme(theme),
            Call::Fonts => self.fonts.install(&self.ctx),
        }
        self.layout_at = Some(Instant::now());
        self.ask_for_redraw();
    }
}

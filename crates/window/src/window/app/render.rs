//! Draws the window: lays out the controls, performs the resulting actions, and presents the frame.

use std::time::{Duration, Instant};

use winit::event_loop::ActiveEventLoop;
use winit::window::Fullscreen;

use super::held_frame::capture_still;
use super::{App, control};
use crate::panel::{self, Canvas};
use crate::present::{Area, Controls, Drawing, Image};
use crate::session::SaveOptions;
use crate::state::{Action, Request, Source, State, ViewMode};
use bokehcam::compute::PictureLocation;
use bokehcam::frame::ColorImage;
use bokehcam_live::sink::card;

/// Shown if there is nothing to save.
const NO_PICTURE: &str = "There is no picture to save.";

/// Shown when the CPU presenter takes over.
const GPU_FAILED: &str = "The GPU failed: the CPU takes over, more slowly.";

/// Assumed picture size until the source is open.
const DEFAULT_SIZE: (u32, u32) = (1280, 720);

impl App {
    pub(super) fn request_redraw(&self) {
        if let Some(gfx) = self.gfx.as_ref().filter(|_| !self.is_hidden()) {
            gfx.window.request_redraw();
        }
    }

    pub(super) fn is_hidden(&self) -> bool {
        self.covered || self.has_zero_size
    }

    pub(super) fn picture_size(&self) -> (u32, u32) {
        match (&self.view, &self.state.source) {
            (Some(view), _) => view.picture.size(),
            (None, Source::Running(running)) => running.size,
            (None, _) => DEFAULT_SIZE,
        }
    }

    /// Lays out the controls and performs the resulting actions.
    pub(super) fn lay_out(&mut self, events: &ActiveEventLoop) {
        let size = self.picture_size();
        let Some(gfx) = &mut self.gfx else { return };
        let available = panel::picture_area_px(&self.ctx);
        let (area, visible_region) = gfx.picture_area(size, available, self.state.zoom, self.state.mirror);
        let canvas = Canvas { area, size, visible_region };
        let input = gfx.input.take_egui_input(&gfx.window);
        let mut actions = Vec::new();
        let (controls, state) = (&mut self.panel, &self.state);
        let output = self.ctx.run_ui(input, |ui| controls.show(ui, state, canvas, &mut actions));
        gfx.input.handle_platform_output(&gfx.window, output.platform_output);
        let primitives = self.ctx.tessellate(output.shapes, output.pixels_per_point);
        let pixels_per_point = output.pixels_per_point;
        gfx.presenter.set_controls(Controls { primitives, textures: output.textures_delta, pixels_per_point });
        self.laid_out_at = Instant::now();
        let wait = output.viewport_output.get(&egui::ViewportId::ROOT).map_or(Duration::MAX, |root| root.repaint_delay);
        self.layout_at = self.laid_out_at.checked_add(wait);
        // A change of the panel's size moves the picture and its overlays: lay out again.
        if panel::picture_area_px(&self.ctx) != available {
            self.layout_at = Some(self.laid_out_at);
            gfx.window.request_redraw();
        }
        if !actions.is_empty() {
            // Lays out again immediately, to show their effect.
            self.layout_at = Some(self.laid_out_at);
            actions.into_iter().for_each(|action| self.perform_action(action, events));
            self.request_redraw();
        }
    }

    /// Applies an action to the state, and carries out its requests or forwards them to the session.
    pub(super) fn perform_action(&mut self, action: Action, events: &ActiveEventLoop) {
        for request in self.state.apply(action) {
            match request {
                Request::Snapshot => self.save_snapshot(),
                Request::CopyCommand => self.session.copy_command(self.state.cli_options()),
                Request::FullScreen(on) => {
                    if let Some(gfx) = &self.gfx {
                        gfx.window.set_fullscreen(on.then_some(Fullscreen::Borderless(None)));
                    }
                }
                Request::Seek(frame) => self.seek_to_frame(frame),
                Request::Off(off) => self.set_off(off),
                Request::CapturePlateAnyway => self.guide.iter().for_each(|guide| guide.ignore_persons()),
                Request::Close => events.exit(),
                Request::Look(look) => {
                    // Before the look, so that it is not applied to a photo's picture without depth.
                    self.state.shows_final_photo &=
                        !self.view.as_ref().is_some_and(|view| self.lacks_depth(view, &look));
                    self.update_held_frame();
                    self.session.send(Request::Look(look));
                }
                other => self.session.send(other),
            }
        }
        self.update_output_request();
        self.update_held_frame();
        self.update_watch();
    }

    /// Sets where the pipeline must deliver pictures. They are read back from the GPU only for uses other than drawing.
    pub(super) fn update_output_request(&self) {
        let drawn_on_gpu = self.gfx.as_ref().is_some_and(|gfx| gfx.presenter.uses_gpu());
        let used_in_memory =
            self.state.frozen || self.state.is_photo() || self.snapshot_due || !self.state.outputs.is_empty();
        self.output_request.set_place(match (drawn_on_gpu, used_in_memory) {
            (false, _) => PictureLocation::Memory,
            (true, false) => PictureLocation::Device,
            (true, true) => PictureLocation::Both,
        });
        // Saved or frozen frames must have their own depth map.
        self.output_request.require_own_depth(self.snapshot_due || self.state.frozen);
    }

    /// Saves the displayed frame. If it is only on the GPU, was blurred between two looks (no settings could reproduce
    /// it), or reuses an earlier frame's depth, saves the next frame without these defects instead.
    pub(super) fn save_snapshot(&mut self) {
        let Some(view) = &self.view else { return self.state.note(NO_PICTURE) };
        let is_running = matches!(self.state.source, Source::Running(_));
        if view.picture.memory().is_none() && !is_running {
            return self.state.note(NO_PICTURE);
        }
        let (is_transitional, is_depth_reused) = (view.is_transitional, view.trace.is_depth_reused);
        let is_frozen = self.state.is_picture_static() && view.picture.memory().is_some();
        self.snapshot_due =
            view.picture.memory().is_none() || is_running && (is_transitional || is_depth_reused && !is_frozen);
        self.update_output_request();
        let Some(still) = capture_still(view, 0).filter(|_| !self.snapshot_due) else { return };
        let request = self.remote_control.as_mut().and_then(control::RemoteControl::take_request);
        self.session.save_frame(still, SaveOptions { with_sources: self.state.preferences.keep_sources, request });
    }

    /// Presents the frame, or its depth, below the controls of the last layout.
    pub(super) fn draw(&mut self, events: &ActiveEventLoop) {
        let size = self.picture_size();
        let hidden = self.is_hidden();
        let Some(gfx) = self.gfx.as_mut().filter(|_| !hidden) else { return };
        let State { mirror, split, source, shown, .. } = &self.state;
        let view = self.view.as_ref();
        let depth = view.and_then(|view| view.depth.as_deref()).filter(|_| *shown == ViewMode::Depth);
        if let Some(depth) = depth.filter(|_| !self.is_depth_drawn) {
            self.depth_view.draw(depth, size);
            self.is_depth_drawn = true;
        }
        let depth = depth.map(|_| self.depth_view.image());
        // While off, the window shows the same card as the outputs.
        if self.state.off && self.card.size() != size {
            self.card = ColorImage::new(size.0, size.1);
            card::draw_card(&mut self.card);
        }
        let none = if self.state.off { &self.card } else { &self.blank_picture };
        let in_memory = view.and_then(|view| view.picture.memory()).unwrap_or(none);
        let on_device = view.and_then(|view| view.picture.device()).filter(|there| gfx.presenter.supports(there));
        let picture = on_device.map_or(Image::Memory(in_memory), Image::Device);
        // If nothing was blurred, before and after are identical.
        let before = view.map(|view| view.color.as_deref().unwrap_or(in_memory));
        let background = if self.ctx.theme() == egui::Theme::Dark { [18, 18, 20] } else { [232, 232, 236] };
        let (area, visible_region) =
            gfx.picture_area(size, panel::picture_area_px(&self.ctx), self.state.zoom, *mirror);
        let drawing = Drawing {
            area: if self.view.is_some() || self.state.off { area } else { Area::default() },
            visible_region,
            picture: depth.map_or(picture, Image::Memory),
            before: before.zip(*split),
            mirror: *mirror,
            stale: self.state.silent_s.is_some() || !matches!(source, Source::Running(_) | Source::Opening),
            background,
        };
        let began_ns = self.clock.now_ns();
        let drawn_on_gpu = gfx.presenter.uses_gpu();
        if let Err(error) = gfx.presenter.present(&drawing) {
            self.failed = Some(error.into());
            return events.exit();
        }
        if drawn_on_gpu && !gfx.presenter.uses_gpu() {
            self.update_output_request();
            self.state.note(GPU_FAILED);
        }
        let now_ns = self.clock.now_ns();
        // Counts each frame once, even if it is drawn repeatedly.
        if let Some(view) = self.view.as_ref().filter(|_| std::mem::take(&mut self.view_is_new)) {
            self.meters.add_frame(view.captured_ns, now_ns, now_ns - began_ns);
        }
        if let Some(input_at) = self.input_at.take() {
            self.meters.reaction.add(input_at.elapsed().as_nanos() as u64);
        }
    }
}

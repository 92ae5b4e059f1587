//! Holds a still picture, which the session blurs again with every look, and decides whether the source is paused or
//! silent.

use std::time::{Duration, Instant};

use super::App;
use crate::session::Still;
use crate::state::Source;
use bokehcam::bokeh::Picture;
use bokehcam::engine::Images;
use bokehcam::link::pool::Pooled;
use bokehcam::look::Look;
use bokehcam::optics::CocField;
use bokehcam_live::pipeline::View;

/// Time a window must be hidden before the source pauses, so that switching windows does not pause it.
const PAUSE_DELAY: Duration = Duration::from_secs(2);
/// Time without a frame after which the user is notified: at least this, and at least this number of frame periods.
const MIN_SILENCE: Duration = Duration::from_secs(2);
const MIN_SILENT_PERIODS: u32 = 10;

impl App {
    /// Starts or ends holding the displayed picture, so that the session blurs it with every new look.
    pub(super) fn update_held_frame(&mut self) {
        if !self.state.is_picture_static() {
            if self.held_number.take().is_some() {
                self.session.release_frame();
            }
            return;
        }
        let Some(view) = self.view.as_ref().filter(|_| self.held_number.is_none()) else { return };
        // While frames arrive, those that are only on the GPU are replaced, because a held frame must be in memory.
        if view.picture.memory().is_none() && matches!(self.state.source, Source::Running(_)) {
            return;
        }
        let Some(still) = capture_still(view, self.last_still_number + 1) else { return };
        self.last_still_number = still.number;
        self.held_number = Some(still.number);
        // A settled photo is blurred again because live frames use a lower quality level.
        let is_outdated = view.is_transitional || self.snapshot_due || self.state.shows_final_photo;
        self.session.hold_frame(still, is_outdated);
    }

    /// Whether a frame lacks the depth that `look` needs, although the source can provide it.
    pub(super) fn lacks_depth(&self, view: &View, look: &Look) -> bool {
        view.depth.is_none() && look.effect.follows_depth() && self.state.may_have_depth()
    }

    /// Shows the held picture with another look. Returns false if another picture is held by now.
    pub(super) fn show_reblurred(&mut self, still: Still) -> bool {
        let Still { number, images: Images { depth, blurred, .. }, coc, change, quality } = still;
        let Some(view) = self.view.as_mut().filter(|_| self.held_number == Some(number)) else { return false };
        if view.color.is_none() {
            view.color = view.picture.memory().cloned().map(Pooled::detached);
        }
        view.picture = Picture::from_memory(Pooled::detached(blurred));
        view.depth = depth.map(Pooled::detached);
        (view.coc, view.change, view.trace.quality) = (coc, change, quality);
        (view.is_transitional, self.state.is_transitional) = (false, false);
        self.state.focus_m = focus_distance_m(&coc);
        self.is_depth_drawn = false;
        if self.snapshot_due {
            self.save_snapshot();
        }
        true
    }

    /// Updates how long a running source has been silent. An unplugged camera reports no error, because it may come
    /// back.
    pub(super) fn update_silence(&mut self) {
        let silent = match &self.state.source {
            Source::Running(running) if self.watch.is_some() && !self.state.off => {
                let patience = MIN_SILENCE.max(Duration::from_nanos(running.period_ns) * MIN_SILENT_PERIODS);
                Some(self.last_frame_at.elapsed()).filter(|silent| *silent > patience)
            }
            _ => None,
        };
        let silent_s = silent.map(|silent| silent.as_secs());
        if std::mem::replace(&mut self.state.silent_s, silent_s) != silent_s {
            self.layout_at = Some(Instant::now());
            self.request_redraw();
        }
    }

    /// Pauses the source while the window is hidden or its picture stands still, unless an output is active.
    pub(super) fn update_watch(&mut self) {
        let is_held = self.held_number.is_some() && self.view.as_ref().is_some_and(may_stay) && !self.snapshot_due;
        self.hidden_at = if self.is_hidden() { self.hidden_at.or_else(|| Some(Instant::now())) } else { None };
        let is_watched = self.hidden_at.is_none_or(|at| at.elapsed() < PAUSE_DELAY);
        match (&self.watch, is_watched && !(is_held && self.state.can_pause_pipeline())) {
            (None, true) => {
                self.watch = Some(self.demand.watch());
                self.last_frame_at = Instant::now();
            }
            (Some(_), false) => self.watch = None,
            (None, false) | (Some(_), true) => {}
        }
    }
}

/// Whether a frame can stay on the screen: it is in memory, to be saved, and has its own depth.
pub(super) fn may_stay(view: &View) -> bool {
    view.picture.memory().is_some() && !view.trace.is_depth_reused
}

/// Copies a frame to memory as still number `number`; `None` if it is only on a device.
pub(super) fn capture_still(view: &View, number: u64) -> Option<Still> {
    let blurred = view.picture.memory();
    let color = view.color.as_deref().or(blurred)?.clone();
    let images = Images { color, depth: view.depth.as_deref().cloned(), blurred: blurred.cloned().unwrap_or_default() };
    Some(Still { number, images, coc: view.coc, change: view.change, quality: view.trace.quality })
}

/// Returns the distance of the focal plane in metres, if the blur follows depth.
pub(super) fn focus_distance_m(coc: &CocField) -> Option<f32> {
    match coc {
        CocField::Depth(coc) => Some(coc.focus_m),
        CocField::Uniform { .. } | CocField::Ramp(_) => None,
    }
}

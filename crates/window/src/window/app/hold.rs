//! The picture that stays: the session blurs it anew with every look; and whether the source rests, or is silent.

use std::time::{Duration, Instant};

use super::App;
use crate::session::Still;
use crate::state::Source;
use bokehcam::bokeh::Picture;
use bokehcam::engine::Images;
use bokehcam::link::pool::Pooled;
use bokehcam::look::Look;
use bokehcam::optics::CocField;
use bokehcam::pipeline::View;

/// A window that was hidden for less than this is only passed by.
const REST_AFTER: Duration = Duration::from_secs(2);
/// After this long without a frame, and this many periods of the source, the person is told.
const SILENCE: Duration = Duration::from_secs(2);
const SILENT_PERIODS: u32 = 10;

impl App {
    /// Has the session blur the picture that stays, if one does, with every look.
    pub(super) fn hold(&mut self) {
        if !self.state.keeps_picture() {
            if self.held.take().is_some() {
                self.session.let_go();
            }
            return;
        }
        let Some(view) = self.view.as_ref().filter(|_| self.held.is_none()) else { return };
        // Frames that are only on the GPU are replaced until one is not, while they come.
        if view.picture.memory().is_none() && matches!(self.state.source, Source::Running(_)) {
            return;
        }
        let Some(still) = still(view, self.holds + 1) else { return };
        self.holds = still.number;
        self.held = Some(still.number);
        // A photo was blurred as well as the time between frames allows.
        let is_behind = view.is_between || self.snapshot_due || self.state.settled;
        self.session.hold(still, is_behind);
    }

    /// Whether a frame was made without the depth that a look follows, and others would have it.
    pub(super) fn lacks_depth(&self, view: &View, look: &Look) -> bool {
        view.depth.is_none() && look.effect.follows_depth() && self.state.may_have_depth()
    }

    /// Shows the picture that stays in another look; whether it is still the one that stays.
    pub(super) fn show_again(&mut self, still: Still) -> bool {
        let Still { number, images: Images { depth, blurred, .. }, coc, change, quality } = still;
        let Some(view) = self.view.as_mut().filter(|_| self.held == Some(number)) else { return false };
        if view.color.is_none() {
            view.color = view.picture.memory().cloned().map(Pooled::detached);
        }
        view.picture = Picture::in_memory(Pooled::detached(blurred));
        view.depth = depth.map(Pooled::detached);
        (view.coc, view.change, view.is_between, view.trace.quality) = (coc, change, false, quality);
        (self.state.focus_m, self.state.between) = (focus_m(&coc), false);
        self.drawn = None;
        if self.snapshot_due {
            self.snapshot();
        }
        true
    }

    /// Updates how long a running source has been silent. A camera that is gone reports no error, as it may come back.
    pub(super) fn check_silence(&mut self) {
        let silent = match &self.state.source {
            Source::Running(running) if self.watch.is_some() && !self.state.off => {
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

    /// Lets the source rest while the window is hidden or has stopped it, unless something is written.
    pub(super) fn watch(&mut self) {
        self.hidden_at = if self.is_hidden() { self.hidden_at.or_else(|| Some(Instant::now())) } else { None };
        let is_passed_by = self.hidden_at.is_none_or(|at| at.elapsed() < REST_AFTER);
        match (&self.watch, is_passed_by && !self.state.stands_still()) {
            (None, true) => {
                self.watch = Some(self.demand.watch());
                self.heard_at = Instant::now();
                self.state.meters.restart();
            }
            (Some(_), false) => self.watch = None,
            (None, false) | (Some(_), true) => {}
        }
    }
}

/// A frame as data, to be known by this number; `None` where it is only on a device.
pub(super) fn still(view: &View, number: u64) -> Option<Still> {
    let blurred = view.picture.memory();
    let color = view.color.as_deref().or(blurred)?.clone();
    let images = Images { color, depth: view.depth.as_deref().cloned(), blurred: blurred.cloned().unwrap_or_default() };
    Some(Still { number, images, coc: view.coc, change: view.change, quality: view.trace.quality })
}

/// Distance of the focal plane of a frame, where its blur follows depth.
pub(super) fn focus_m(coc: &CocField) -> Option<f32> {
    match coc {
        CocField::Depth(coc) => Some(coc.focus_m),
        CocField::Uniform { .. } | CocField::Ramp(_) => None,
    }
}

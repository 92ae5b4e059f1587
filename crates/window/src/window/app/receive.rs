//! What comes from the session: news, and frames.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use winit::event_loop::ActiveEventLoop;

use super::App;
use super::seek::Seeking;
use crate::session::SessionEvent;
use crate::state::Source;
use bokehcam::link::Receiver;
use bokehcam::pipeline::View;

/// Where a recording is, is shown anew so often while it plays.
const BAR_EVERY: Duration = Duration::from_millis(250);

impl App {
    /// Handles what the session sent, and takes the newest frame.
    pub(super) fn receive(&mut self, events: &ActiveEventLoop) {
        // First of all, so that what comes after the queue was read wakes this thread again.
        self.wake_pending.swap(false, Ordering::AcqRel);
        let mut changed = false;
        while let Some(event) = self.session.hear() {
            match event {
                SessionEvent::Views(frames, guide, seeker) => {
                    self.guide = guide;
                    (self.seeking, self.state.transport, self.state.settled) = (Seeking::of(seeker), None, false);
                    changed |= self.state.guide(None);
                    self.heard_at = Instant::now();
                    // It was meant for the source before.
                    self.snapshot_due = false;
                    self.frames = Some(frames);
                    self.state.meters.restart();
                }
                SessionEvent::Blurred(blurred) => changed |= self.show_again(*blurred),
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
            self.update_settings();
            self.layout_at = Some(Instant::now());
            self.update_wanted();
            self.set_title();
            if self.close_at_end && matches!(self.state.source, Source::Ended | Source::Lost(_)) {
                events.exit();
            }
        }
        // What was on its way when it was switched off is not for the screen either.
        let newest = self.frames.as_mut().and_then(Receiver::try_recv).filter(|_| !self.state.off);
        if newest.is_some() {
            self.heard_at = Instant::now();
            self.check_silence();
            if self.state.guide(self.guide.as_ref().map(|guide| guide.step())) {
                self.layout_at = Some(Instant::now());
                changed = true;
            }
        }
        // A frozen frame has to be in memory, to be saved, and have depth of its own: frames are replaced until one is.
        let stays = self.state.frozen || self.state.settled;
        let may_stay = |view: &View| view.picture.memory().is_some() && !view.trace.depth_held;
        let stays = stays && self.view.as_ref().is_some_and(may_stay);
        if let Some(view) = newest.filter(|view| !stays || self.seeking.is_answer(view)) {
            self.note_place(&view);
            if self.state.transport.is_some() && self.laid_out.elapsed() > BAR_EVERY {
                self.layout_at = Some(Instant::now());
            }
            self.learn_from(&view);
            let is_whole = view.picture.memory().is_some() && !view.is_between && !view.trace.depth_held;
            // A number of frames that was asked for is shown.
            let may_settle = self.state.is_photo() && !self.close_at_end;
            self.state.settled = may_settle && is_whole && !self.lacks_depth(&view, &self.state.look);
            // Another frame stays now.
            self.held = None;
            self.view = Some(view);
            self.view_is_new = true;
            changed = true;
            if self.snapshot_due {
                self.snapshot();
            }
        }
        self.hold();
        self.watch();
        if changed {
            self.ask_for_redraw();
        }
    }
}

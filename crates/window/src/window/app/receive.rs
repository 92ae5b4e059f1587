//! Receives updates and frames from the session.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use winit::event_loop::ActiveEventLoop;

use super::App;
use super::held_frame::may_stay;
use super::seek::SeekState;
use crate::session::SessionEvent;
use crate::state::Source;
use bokehcam::link::Receiver;

/// Update interval of the playback position.
const POSITION_PERIOD: Duration = Duration::from_millis(250);

impl App {
    /// Handles the session's events, and takes the newest frame.
    pub(super) fn process_session(&mut self, events: &ActiveEventLoop) {
        // Before reading the queue, so that later events wake this thread again.
        self.wake_pending.swap(false, Ordering::AcqRel);
        let mut changed = false;
        while let Some(event) = self.session.try_recv_event() {
            changed |= self.handle_session_event(event);
        }
        if changed {
            self.layout_at = Some(Instant::now());
            self.update_output_request();
            self.set_title();
            if self.close_at_end && matches!(self.state.source, Source::Ended | Source::Lost(_)) {
                events.exit();
            }
        }
        changed |= self.take_newest_frame();
        self.update_held_frame();
        self.update_watch();
        if changed {
            self.request_redraw();
        }
    }

    /// Handles an event of the session. Returns whether it changed what is shown.
    fn handle_session_event(&mut self, event: SessionEvent) -> bool {
        match event {
            SessionEvent::RunStarted(frames, guide, seeker) => {
                self.guide = guide;
                (self.seek_state, self.state.transport, self.state.shows_final_photo) =
                    (SeekState::new(seeker), None, false);
                self.last_frame_at = Instant::now();
                // A pending snapshot was meant for the previous source.
                self.snapshot_due = false;
                self.frames = Some(frames);
                self.state.set_plate_step(None)
            }
            SessionEvent::Reblurred(blurred) => self.show_reblurred(*blurred),
            SessionEvent::Copy(text) => {
                if let Some(gfx) = &mut self.gfx {
                    gfx.input.set_clipboard_text(text);
                }
                false
            }
            SessionEvent::Update(update) => {
                if let Some(look) = self.state.apply_update(update) {
                    self.session.send(look);
                }
                true
            }
        }
    }

    /// Takes the newest frame. Returns whether it changed what is shown.
    fn take_newest_frame(&mut self) -> bool {
        let mut changed = false;
        // Discards frames that were in flight when the picture was switched off.
        let newest = self.frames.as_mut().and_then(Receiver::try_recv).filter(|_| !self.state.off);
        if newest.is_some() {
            self.last_frame_at = Instant::now();
            self.update_silence();
            if self.state.set_plate_step(self.guide.as_ref().map(|guide| guide.step())) {
                self.layout_at = Some(Instant::now());
                changed = true;
            }
        }
        // A frozen frame must be in memory, to be saved, and have its own depth: frames are replaced until both hold.
        let stays = self.state.frozen || self.state.shows_final_photo;
        let stays = stays && self.view.as_ref().is_some_and(may_stay);
        if let Some(view) = newest.filter(|view| !stays || self.seek_state.is_requested_frame(view)) {
            self.update_position(&view);
            if self.state.transport.is_some() && self.laid_out_at.elapsed() > POSITION_PERIOD {
                self.layout_at = Some(Instant::now());
            }
            self.update_from_frame(&view);
            let is_whole = view.picture.memory().is_some() && !view.is_transitional && !view.trace.is_depth_reused;
            // With `close_at_end`, all requested frames are shown.
            let may_settle = self.state.is_photo() && !self.close_at_end;
            self.state.shows_final_photo = may_settle && is_whole && !self.lacks_depth(&view, &self.state.look);
            // The new frame must be held anew.
            self.held_number = None;
            self.view = Some(view);
            (self.view_is_new, self.is_depth_drawn) = (true, false);
            changed = true;
            if self.snapshot_due {
                self.save_snapshot();
            }
        }
        changed
    }
}

//! The switch of a shutter, for any thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender, SyncSender};
use std::time::{Duration, Instant};

use super::OutputWithoutCard;
#[cfg(doc)]
use super::Shutter;
use bokehcam::frame::ColorImage;

/// Longest wait for outputs to show the card.
const CARD_TIMEOUT: Duration = Duration::from_millis(500);

/// Closes and opens a [`Shutter`], and copies pictures behind it, from any thread.
#[derive(Clone)]
pub struct ShutterControl {
    pub(super) closed: Arc<AtomicBool>,
    pub(super) request_sender: Sender<Request>,
    /// The whole sink as one output.
    pub(super) whole_sink: OutputWithoutCard,
}

/// Requests to a shutter, each with its reply channel. A requester that has timed out is ignored.
pub(super) enum Request {
    CopyPicture(SyncSender<ColorImage>),
    WaitForCard(SyncSender<Vec<OutputWithoutCard>>, Instant),
}

/// These live outputs may still show a picture instead of the card.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no more pictures are sent, but {0} may still show the last one: it did not accept the card")]
pub struct CardNotShown(pub String);

impl ShutterControl {
    /// Blocks pictures from now on, or lets them pass again.
    pub fn close(&self, closed: bool) {
        self.closed.store(closed, Ordering::Release);
    }

    /// Closes it if it is open, and opens it if it is closed, in one step, as several clients may ask at once. Returns
    /// whether it is closed now.
    pub fn toggle(&self) -> bool {
        !self.closed.fetch_not(Ordering::AcqRel)
    }

    /// Whether it is closed.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }

    /// Returns a copy of the next picture that passes; `None` if none does in time.
    pub fn copy_next_picture(&self, timeout: Duration) -> Option<ColorImage> {
        let (to, reply) = mpsc::sync_channel(1);
        self.request_sender.send(Request::CopyPicture(to)).ok()?;
        reply.recv_timeout(timeout).ok()
    }

    /// Waits until every output shows the card, after [`ShutterControl::close`]. Returns a note about outputs that do not yet,
    /// if they are not live.
    ///
    /// # Errors
    /// A live output may still show a picture.
    pub fn wait_for_card(&self) -> Result<Option<String>, CardNotShown> {
        let (to, reply) = mpsc::sync_channel(1);
        // A run that has ended shows nothing.
        let sent = self.request_sender.send(Request::WaitForCard(to, Instant::now() + CARD_TIMEOUT));
        let without_card = match sent.map(|()| reply.recv_timeout(2 * CARD_TIMEOUT)) {
            Ok(Ok(without_card)) => without_card,
            // The thread that sends the pictures is blocked by one of the outputs.
            Ok(Err(RecvTimeoutError::Timeout)) => vec![self.whole_sink.clone()],
            Ok(Err(RecvTimeoutError::Disconnected)) | Err(_) => Vec::new(),
        };
        let names = |is_live: bool| {
            let names = without_card.iter().filter(|left| left.is_live == is_live).map(|left| left.output.as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        match [names(true), names(false)] {
            [live, _] if !live.is_empty() => Err(CardNotShown(live)),
            [_, others] if !others.is_empty() => Ok(Some(format!("{others}: busy, so the card appears there later"))),
            _ => Ok(None),
        }
    }
}

//! Plays a video behind the subject: a thread decodes ahead, so that a live stream never waits for it.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TryRecvError};
use std::thread;

use crate::depth::backdrop::BackgroundVideo;
use crate::frame::ColorImage;

/// Pictures that are decoded ahead.
const AHEAD: usize = 2;

/// A picture with its time in the loop, in nanoseconds; or why there are no more.
type Decoded = Result<(u64, ColorImage), String>;

/// A video in a loop, at its own rate against the time of a stream.
pub(super) struct BackdropPlayer {
    video: Arc<dyn BackgroundVideo>,
    pictures: Receiver<Decoded>,
    /// Returns pictures to the decoder, to be overwritten.
    shown: Sender<ColorImage>,
    /// The picture that comes next, and its time.
    next: Option<(u64, ColorImage)>,
    /// Time of the stream at which the video began.
    began_ns: Option<u64>,
    /// Whether a late picture is waited for; if not, the previous one stays.
    waits: bool,
    /// Whether there are no more pictures.
    has_ended: bool,
}

impl BackdropPlayer {
    /// Starts to decode pictures that cover frames of `size`. If it `waits`, results depend on the times of frames only;
    /// if not, a picture that is late is left out.
    ///
    /// # Errors
    /// The system refuses the thread.
    pub fn start(video: Arc<dyn BackgroundVideo>, size: (u32, u32), waits: bool) -> io::Result<Self> {
        let (to_player, pictures) = mpsc::sync_channel(AHEAD);
        let (shown, free) = mpsc::channel();
        let decoded = Arc::clone(&video);
        thread::Builder::new().name("behind".into()).spawn(move || decode(&*decoded, size, &to_player, &free))?;
        Ok(Self { video, pictures, shown, next: None, began_ns: None, waits, has_ended: false })
    }

    /// Returns whether it plays this video.
    pub fn plays(&self, video: &Arc<dyn BackgroundVideo>) -> bool {
        Arc::ptr_eq(&self.video, video)
    }

    /// Takes the picture to show at `time_ns` of the stream, if it is another one than before. The video begins with the
    /// first call. Warns once if it ends early: its last picture stays.
    pub fn take_picture(&mut self, time_ns: u64, into: &mut ColorImage) -> bool {
        let at_ns = time_ns.saturating_sub(*self.began_ns.get_or_insert(time_ns));
        let mut is_new = false;
        while let Some((_, mut picture)) = self.receive_next().take_if(|(due_ns, _)| *due_ns <= at_ns) {
            std::mem::swap(into, &mut picture);
            // Without the decoder no picture is needed.
            let _ = self.shown.send(picture);
            is_new = true;
        }
        is_new
    }

    /// Receives the next picture, unless it is there already.
    fn receive_next(&mut self) -> &mut Option<(u64, ColorImage)> {
        if self.next.is_none() && !self.has_ended {
            let received = match self.waits {
                true => self.pictures.recv().map_err(|_| TryRecvError::Disconnected),
                false => self.pictures.try_recv(),
            };
            match received {
                Ok(Ok(next)) => self.next = Some(next),
                Ok(Err(why)) => {
                    tracing::warn!("--behind video:{}: {why}; its last picture stays", self.video.file().display());
                    self.has_ended = true;
                }
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => self.has_ended = true,
            }
        }
        &mut self.next
    }
}

/// Decodes a video again and again until its player is gone, or it cannot go on.
fn decode(video: &dyn BackgroundVideo, size: (u32, u32), to_player: &SyncSender<Decoded>, free: &Receiver<ColorImage>) {
    let played = video.play(size, &mut |time_ns, picture| {
        let empty = free.try_recv().unwrap_or_default();
        to_player.send(Ok((time_ns, std::mem::replace(picture, empty)))).is_ok()
    });
    if let Err(why) = played {
        // The player may be gone.
        let _ = to_player.send(Err(why));
    }
}

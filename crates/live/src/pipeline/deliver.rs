//! Last stage, on the caller's thread: delivers pictures to the sink.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

use super::blur::Blurred;
use super::frame::Frame;
use super::playout::PlayoutDelay;
use super::{Progress, Shared, StageResult, Trace, View};
use crate::sink::{Sink, SinkError};
use crate::stats::{DropCause, FrameTicket, SinkTimings};
use bokehcam::bokeh::Picture;
use bokehcam::budget::Quality;
use bokehcam::depth::backdrop::CutOut;
use bokehcam::frame::ColorImage;
use bokehcam::frame::crop::Cropper;
use bokehcam::link::{self, Received, Receiver, Sender};
use bokehcam::optics::CocField;

pub(super) struct Stage<'a> {
    sink: &'a mut dyn Sink,
    /// A viewer that receives every frame as well.
    view: Option<Sender<View>>,
    mirror: bool,
    progress: &'a dyn Fn(Progress),
    /// When pictures are due; `None` shows them at once.
    playout: Option<PlayoutDelay>,
    shared: &'a Shared,
    times: &'a mut SinkTimings,
    cropper: Cropper,
    /// The crop that goes out.
    cropped: ColorImage,
    /// The crop of the picture's foreground mask.
    cropped_kept: ColorImage,
    cut_out: CutOut,
}

impl<'a> Stage<'a> {
    pub(super) fn new(
        sink: &'a mut dyn Sink,
        (view, progress): (Option<Sender<View>>, &'a dyn Fn(Progress)),
        mirror: bool,
        shared: &'a Shared,
        times: &'a mut SinkTimings,
    ) -> Self {
        let playout = shared.realtime_period_ns.map(PlayoutDelay::new);
        Self {
            sink,
            view,
            mirror,
            progress,
            playout,
            shared,
            times,
            cropper: Cropper::default(),
            cropped: ColorImage::default(),
            cropped_kept: ColorImage::default(),
            cut_out: CutOut::default(),
        }
    }

    /// Delivers frames until they end, as many as asked of a live source were, the sink is closed, or the viewer is gone.
    pub(super) fn run(mut self, mut from: Receiver<Frame<Blurred>>) -> StageResult {
        let Shared { clock, counter, .. } = self.shared;
        let mut last_ns = None;
        // Ticket of the frame sent to the viewer last, if its delivery depends on the viewer.
        let mut at_viewer = None;
        loop {
            let wants_yuyv = self.view.is_none() && !self.mirror && self.sink.wants_yuyv();
            self.shared.wants_yuyv.store(wants_yuyv, Ordering::Relaxed);
            let mut frame = match self.receive_next(&mut from) {
                Received::Item(frame) => frame,
                Received::Nothing => match self.sink.repeat_frame()? {
                    ControlFlow::Continue(shown) => {
                        self.times.repeats += u64::from(shown);
                        continue;
                    }
                    ControlFlow::Break(()) => break,
                },
                Received::Ended => break,
            };
            let is_cropped = self.crop_and_mirror(&mut frame.item);
            let has_alpha = self.separate_alpha(&mut frame.item, is_cropped);
            let (mut frame, mut blurred) = frame.take_item(clock.now_ns());
            let captured_ns = frame.ticket.captured_ns;
            let mut began_ns = frame.since_ns;
            // Wait for the frame's play-out time, against jitter.
            if let Some(playout) = &mut self.playout {
                clock.sleep_until_ns(playout.due_time_ns(captured_ns, frame.since_ns));
                began_ns = clock.now_ns();
                self.times.playout.add(began_ns - frame.since_ns);
            }
            frame.trace.age_ns = began_ns.saturating_sub(captured_ns);
            let (form, time_ns) = ((is_cropped, has_alpha), frame.stamp.time_ns);
            let was_given = match self.write_to_sink(&mut blurred.picture, form, captured_ns, time_ns) {
                Ok(ControlFlow::Continue(was_given)) => was_given,
                Ok(ControlFlow::Break(())) => break,
                Err(error) => {
                    counter.count_dropped(frame.ticket, DropCause::Failed);
                    return Err(error.into());
                }
            };
            let now_ns = clock.now_ns();
            self.times.took.add(now_ns - began_ns);
            self.times.latency.add(now_ns.saturating_sub(captured_ns));
            if let Some(last_ns) = last_ns.replace(now_ns) {
                self.times.frame.add(now_ns - last_ns);
            }
            log_frame(frame.stamp.index, &blurred.coc, &frame.trace);
            let quality = frame.trace.quality;
            let is_kept = was_given && self.sink.has_outputs();
            if let Err(link::Abandoned) = self.send_to_viewer(frame, blurred, is_kept, &mut at_viewer) {
                return Ok(());
            }
            self.report_progress(quality);
            if self.is_complete() {
                break;
            }
        }
        // The viewer still takes the last frame.
        self.count_viewed(true, at_viewer);
        Ok(())
    }

    /// Sends a frame to the viewer, if there is one. A frame that the sink does not keep counts as delivered once the
    /// viewer took it.
    ///
    /// # Errors
    /// The viewer is gone; the fate of this frame and of the previous one is unknown, and both stay in flight.
    fn send_to_viewer(
        &mut self,
        frame: Frame<()>,
        Blurred { picture, color, depth, coc, crop, .. }: Blurred,
        is_kept: bool,
        at_viewer: &mut Option<FrameTicket>,
    ) -> Result<(), link::Abandoned> {
        let Frame { ticket, stamp, seek, is_seek_target, change, is_transitional, trace, .. } = frame;
        let captured_ns = ticket.captured_ns;
        let (done, open) = if self.view.is_none() || is_kept { (Some(ticket), None) } else { (None, Some(ticket)) };
        done.into_iter().for_each(|ticket| self.shared.counter.count_delivered(ticket));
        let Some(view) = &mut self.view else { return Ok(()) };
        let displaced = view.send(View {
            picture,
            color,
            depth,
            coc,
            stamp,
            captured_ns,
            crop,
            change,
            is_transitional,
            seek,
            is_seek_target,
            trace,
        })?;
        // A displaced frame is the previous one, which the viewer did not take.
        self.count_viewed(displaced.is_none(), std::mem::replace(at_viewer, open));
        Ok(())
    }

    /// Whether a live source, which does not end by itself, has delivered as many frames as were asked of it.
    fn is_complete(&self) -> bool {
        let Shared { counter, info, .. } = self.shared;
        info.is_complete(counter.frame_counts().delivered)
    }

    /// Reports the progress of the run; `quality` is that of the last frame.
    fn report_progress(&self, quality: Option<Quality>) {
        let Shared { counter, info, .. } = self.shared;
        let frames = counter.frame_counts();
        (self.progress)(Progress {
            captured: frames.captured,
            delivered: frames.delivered,
            dropped: frames.dropped.total(),
            total: info.frames,
            quality,
        });
    }

    /// Crops and mirrors the picture that goes out; returns whether it was cropped.
    fn crop_and_mirror(&mut self, Blurred { picture, crop, kept, .. }: &mut Blurred) -> bool {
        let whole = crop.zip(picture.memory());
        let is_cropped = whole.map(|(crop, whole)| self.cropper.crop(whole, &crop, &mut self.cropped)).is_some();
        if let Some((crop, kept)) = crop.zip(kept.as_deref()) {
            self.cropper.crop(&kept.blurred, &crop, &mut self.cropped_kept);
        }
        if self.mirror {
            let out = if is_cropped { Some(&mut self.cropped) } else { picture.memory_mut() };
            out.map(mirror_picture);
            let kept = if is_cropped {
                Some(&mut self.cropped_kept)
            } else {
                kept.as_deref_mut().map(|kept| &mut kept.blurred)
            };
            kept.map(mirror_picture);
        }
        is_cropped
    }

    /// Makes straight colours and alpha of the picture that goes out, if its background is transparent and the sink keeps
    /// that; returns whether it did.
    fn separate_alpha(&mut self, Blurred { picture, kept, .. }: &mut Blurred, is_cropped: bool) -> bool {
        let Some(kept) = kept.as_deref().filter(|_| self.sink.keeps_alpha()) else { return false };
        let (out, kept) = match is_cropped {
            true => (Some(&mut self.cropped), &self.cropped_kept),
            false => (picture.memory_mut(), &kept.blurred),
        };
        out.map(|out| self.cut_out.unpremultiply(out, kept)).is_some()
    }

    /// Passes a picture to the sink if it is in memory; `Continue` says whether it was.
    fn write_to_sink(
        &mut self,
        picture: &mut Picture,
        (is_cropped, has_alpha): (bool, bool),
        captured_ns: u64,
        time_ns: u64,
    ) -> Result<ControlFlow<(), bool>, SinkError> {
        let flow = if let Some(yuyv) = picture.yuyv_mut() {
            self.sink.set_capture_time(captured_ns);
            self.sink.write_yuyv(yuyv, time_ns)?
        } else if let Some(whole) = picture.memory() {
            self.sink.set_capture_time(captured_ns);
            let out = if is_cropped { &self.cropped } else { whole };
            match has_alpha {
                true => self.sink.write_with_alpha(out, &self.cut_out.alpha, time_ns)?,
                false => self.sink.write_frame(out, time_ns)?,
            }
        } else {
            self.sink.skip_frame();
            return Ok(ControlFlow::Continue(false));
        };
        Ok(flow.map_continue(|()| true))
    }

    /// Counts a frame whose delivery depended on the viewer: delivered if it was taken, otherwise evicted.
    fn count_viewed(&self, taken: bool, ticket: Option<FrameTicket>) {
        match ticket {
            Some(ticket) if taken => self.shared.counter.count_delivered(ticket),
            Some(ticket) => self.shared.counter.count_dropped(ticket, DropCause::Evicted),
            None => {}
        }
    }

    /// Receives the next frame; `Nothing` if the sink must repeat its last picture first.
    fn receive_next<T>(&self, from: &mut Receiver<T>) -> Received<T> {
        match self.sink.repeat_interval() {
            Some(interval) => from.recv_timeout(interval),
            None => from.recv().map_or(Received::Ended, Received::Item),
        }
    }
}

/// Logs a delivered frame at trace level.
fn log_frame(index: usize, coc: &CocField, trace: &Trace) {
    let ms = |ns: u64| ns as f64 / 1e6;
    let focus_m = if let CocField::Depth(lens) = coc { Some(lens.focus_m) } else { None };
    let quality = trace.quality.map(Quality::name);
    let (depth_ms, blur_ms, age_ms, depth_held) =
        (ms(trace.depth_ns), ms(trace.blur_ns), ms(trace.age_ns), trace.is_depth_reused);
    tracing::trace!(index, focus_m, quality, depth_held, depth_ms, blur_ms, age_ms, "frame");
}

/// Mirrors a picture left to right.
fn mirror_picture(picture: &mut ColorImage) {
    let row_bytes = picture.width as usize * 3;
    for row in picture.rgb.chunks_exact_mut(row_bytes.max(1)) {
        row.as_chunks_mut::<3>().0.reverse();
    }
}

//! The instrumented ends of the pipeline.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bokehcam::bokeh::{BlurredFrame, Bokeh, BokehError, Job};
use bokehcam::clock::Clock;
use bokehcam::compute::Backend;
use bokehcam::frame::{ColorImage, Stamp};
use bokehcam_live::capture::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::sink::{Ending, Sink, SinkError};
use bokehcam_live::stats::DropCause;
use bokehcam_media::recording::{Recording, Scratch};

/// Frame period.
pub const PERIOD_NS: u64 = 33_333_333;

/// The delivery times of the pictures.
#[derive(Clone, Default)]
pub struct Stamps {
    /// The time when the camera began.
    epoch_ns: Arc<AtomicU64>,
    /// Time since then, and age of each picture.
    shown: Arc<Mutex<Vec<(u64, u64)>>>,
}

impl Stamps {
    pub fn with_capacity(frames: usize) -> Self {
        // Written once, so that the system commits the memory now and not during the run.
        let mut shown = vec![(1, 1); frames];
        shown.clear();
        Self { shown: Arc::new(Mutex::new(shown)), ..Self::default() }
    }

    pub fn take_deliveries(&self) -> Vec<(u64, u64)> {
        std::mem::take(&mut self.shown.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Loops a recording as a live camera of 30 frames a second: a frame is captured when it is due, and decoded then; a
/// frame that is not read within a period is overwritten.
pub struct LoopedCamera {
    recording: Arc<Recording>,
    scratch: Scratch,
    name: String,
    clock: Clock,
    stamps: Stamps,
    position: u64,
    frames: u64,
}

impl LoopedCamera {
    pub fn new(recording: Arc<Recording>, name: &str, frames: u64, clock: Clock, stamps: Stamps) -> Self {
        Self { recording, scratch: Scratch::default(), name: name.to_owned(), clock, stamps, position: 0, frames }
    }
}

impl Camera for LoopedCamera {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: self.name.clone(),
            size: self.recording.size(),
            period_ns: PERIOD_NS,
            frames: Some(self.frames),
            live: true,
            frame_data: FrameData::Color,
        }
    }

    fn next(&mut self, shot: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.position >= self.frames {
            return Ok(Captured::End);
        }
        let now_ns = self.clock.now_ns();
        if self.position == 0 {
            self.stamps.epoch_ns.store(now_ns, Ordering::Relaxed);
        }
        let due_ns = self.stamps.epoch_ns.load(Ordering::Relaxed) + self.position * PERIOD_NS;
        let overwritten = (now_ns.saturating_sub(due_ns) / PERIOD_NS).min(self.frames - self.position);
        if overwritten > 0 {
            self.position += overwritten;
            return Ok(Captured::Lost(overwritten, DropCause::Driver));
        }
        self.clock.sleep_until_ns(due_ns);
        let index = (self.position % self.recording.len() as u64) as usize;
        let time_ns = self.position * PERIOD_NS;
        self.position += 1;
        Ok(match self.recording.read_color(index, &mut self.scratch, shot.color) {
            Ok(()) => Captured::Frame(Stamp { index, time_ns, captured_ns: Some(due_ns) }),
            Err(error) => Captured::Corrupt(error.into()),
        })
    }
}

/// An executor that is slower by `factor`, and writes the frame's number into each picture.
pub struct SlowedBokeh {
    inner: Box<dyn Bokeh>,
    factor: f64,
    wasted: Duration,
}

impl SlowedBokeh {
    pub fn new(inner: Box<dyn Bokeh>, factor: f64) -> Self {
        Self { inner, factor, wasted: Duration::ZERO }
    }
}

impl Bokeh for SlowedBokeh {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        let began = Instant::now();
        self.inner.submit(job)?;
        let done = Instant::now();
        self.wasted = (done - began).mul_f64((self.factor - 1.0).max(0.0));
        while done.elapsed() < self.wasted {
            std::hint::spin_loop();
        }
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        let mut finished = self.inner.collect(wait)?;
        if let Some(finished) = &mut finished {
            if self.factor > 1.0 {
                finished.times.add("wasted", self.wasted);
            }
            if let Some(first) = finished.picture.memory_mut().and_then(|picture| picture.rgb.first_chunk_mut()) {
                *first = finished.ticket.to_le_bytes();
            }
        }
        Ok(finished)
    }

    fn in_flight(&self) -> usize {
        self.inner.in_flight()
    }
    fn capacity(&self) -> usize {
        self.inner.capacity()
    }
    fn backend(&self) -> Backend {
        self.inner.backend()
    }
    fn describe(&self) -> String {
        self.inner.describe()
    }
}

/// Discards the pictures and records their times.
pub struct StampingSink {
    clock: Clock,
    stamps: Stamps,
    shown: ColorImage,
}

impl StampingSink {
    pub fn new(clock: Clock, stamps: Stamps) -> Self {
        Self { clock, stamps, shown: ColorImage::default() }
    }
}

impl Sink for StampingSink {
    fn write_frame(&mut self, picture: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        let now_ns = self.clock.now_ns() - self.stamps.epoch_ns.load(Ordering::Relaxed);
        let ticket = picture.rgb.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
        let age_ns = now_ns.saturating_sub(ticket * PERIOD_NS);
        self.stamps.shown.lock().unwrap_or_else(PoisonError::into_inner).push((now_ns, age_ns));
        // Costs as much as handing the picture to a device.
        self.shown.clone_from(picture);
        Ok(ControlFlow::Continue(()))
    }

    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }

    fn describe(&self) -> String {
        "a sink that stamps".to_string()
    }
}

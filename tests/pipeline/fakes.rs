//! Stages that do little, and that badly when told so; and a run of them.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::Duration;

use bokehcam::bokeh::{Bokeh, BokehError, Finished, Job, PassTimes, Picture};
use bokehcam::capture::{Brings, Camera, CaptureError, Captured, Shot, SourceInfo};
use bokehcam::compute::Backend;
use bokehcam::compute::GpuError;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::optics::CocField;
use bokehcam::sink::{Ending, Sink, SinkError};

pub const SIZE: (u32, u32) = (6, 4);
pub const PERIOD_NS: u64 = 1_000_000;
pub const NEVER: usize = usize::MAX;
/// Bytes of a picture that the fake blur changes.
pub const BLURRED: usize = 12;

/// What a fake stage does at one of its frames.
#[derive(Clone, Copy, Default)]
pub struct Trouble {
    pub stall: Duration,
    pub fails_at: Option<usize>,
    pub panics_at: Option<usize>,
}

impl Trouble {
    pub fn slow() -> Self {
        Self { stall: Duration::from_millis(3), ..Self::default() }
    }
    pub fn fails_at(frame: usize) -> Self {
        Self { fails_at: Some(frame), ..Self::default() }
    }
    pub fn panics_at(frame: usize) -> Self {
        Self { panics_at: Some(frame), ..Self::default() }
    }
    /// Whether this frame fails.
    fn strikes(&self, frame: usize) -> bool {
        sleep(self.stall);
        assert!(self.panics_at != Some(frame), "out of order at frame {frame}");
        self.fails_at == Some(frame)
    }
}

/// Frames whose every byte is the lowest of their number, and the last two bytes all of it.
pub struct FakeCamera {
    pub frames: usize,
    pub next: usize,
    pub corrupt_every: usize,
    pub brings: Brings,
    pub trouble: Trouble,
}

fn size_error() -> CaptureError {
    CaptureError::Format { width: 0, height: 0, fps: 0.0 }
}

impl Camera for FakeCamera {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: "fake camera".into(),
            size: SIZE,
            period_ns: PERIOD_NS,
            frames: Some(self.frames as u64),
            live: false,
            brings: self.brings,
        }
    }

    fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError> {
        if self.next >= self.frames {
            return Ok(Captured::End);
        }
        let index = self.next;
        self.next += 1;
        if self.trouble.strikes(index) {
            return Err(size_error());
        }
        if index % self.corrupt_every == self.corrupt_every - 1 {
            return Ok(Captured::Corrupt(size_error()));
        }
        let Shot { color, depth, right } = shot;
        color.resize(SIZE.0, SIZE.1);
        color.rgb.fill(index as u8);
        color.rgb.last_chunk_mut::<2>().unwrap().copy_from_slice(&(index as u16).to_le_bytes());
        if self.brings == Brings::Depth {
            depth.resize(SIZE.0, SIZE.1);
            depth.metres.fill(1.0 + index as f32);
        }
        if self.brings == Brings::RightCamera {
            right.resize(SIZE.0, SIZE.1);
            right.luma.fill(index as u8);
        }
        Ok(Captured::Frame(Stamp { index, time_ns: index as u64 * PERIOD_NS, captured_ns: None }))
    }

    fn skip(&mut self, until_ns: u64) -> u64 {
        let from = self.next;
        self.next = (until_ns.div_ceil(PERIOD_NS) as usize).clamp(from, self.frames);
        (self.next - from) as u64
    }
}

/// Depth of 1 m plus the frame's number, with a hole.
pub struct FakeDepth(pub Trouble);

impl DepthSource for FakeDepth {
    fn read(&mut self, FrameInput { stamp, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        let index = stamp.index;
        if self.0.strikes(index) {
            return Err(DepthError::NoDepth { source_name: format!("frame {index}") });
        }
        map.resize(SIZE.0, SIZE.1);
        map.metres.fill(1.0 + index as f32);
        map.metres[3] = 0.0;
        Ok(())
    }
}

/// Adds 100 to the first bytes of the picture, and the focus distance to its first byte; holds as many frames as it may.
pub struct FakeBokeh {
    pub capacity: usize,
    pub held: VecDeque<Job>,
    pub submitted: usize,
    pub trouble: Trouble,
    pub collect_fails: bool,
    pub loses_frames: bool,
}

impl Bokeh for FakeBokeh {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        assert!(self.held.len() < self.capacity, "submitted beyond the capacity");
        let index = self.submitted;
        self.submitted += 1;
        if self.trouble.strikes(index) && !self.collect_fails {
            return Err(GpuError::Failed("lost".into()).into());
        }
        self.held.push_back(job);
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError> {
        if self.collect_fails && self.trouble.fails_at.is_some_and(|frame| self.submitted > frame) {
            return Err(GpuError::Failed("lost".into()).into());
        }
        if self.loses_frames || !wait && self.held.len() < self.capacity {
            return Ok(None);
        }
        Ok(self.held.pop_front().map(|mut job| {
            job.out.resize(job.color.width, job.color.height);
            job.out.rgb.copy_from_slice(&job.color.rgb);
            job.out.rgb[..BLURRED].iter_mut().for_each(|byte| *byte = byte.wrapping_add(100));
            if let CocField::Depth(coc) = job.coc {
                let map = job.depth.as_ref().expect("dof has depth");
                assert!(map.metres.iter().all(|&z_m| z_m == map.metres[0]), "holes are filled");
                job.out.rgb[0] = coc.focus_m.round() as u8;
            }
            let mut times = PassTimes::new();
            times.add("rows", Duration::from_micros(400));
            times.add("columns", Duration::from_micros(300));
            Finished {
                ticket: job.ticket,
                picture: Picture::in_memory(job.out),
                color: job.color,
                depth: job.depth,
                times,
            }
        }))
    }

    fn in_flight(&self) -> usize {
        self.held.len()
    }
    fn capacity(&self) -> usize {
        self.capacity
    }
    fn backend(&self) -> Backend {
        Backend::Cpu
    }
    fn describe(&self) -> String {
        "cpu, fake".into()
    }
}

/// What a sink received, seen from outside.
#[derive(Clone, Default)]
pub struct Received {
    pub pictures: Arc<Mutex<Vec<Vec<u8>>>>,
    pub times_ns: Arc<Mutex<Vec<u64>>>,
    pub ending: Arc<Mutex<Option<Ending>>>,
}

impl Received {
    pub fn count(&self) -> u64 {
        self.pictures.lock().unwrap().len() as u64
    }
    pub fn numbers(&self) -> Vec<usize> {
        self.pictures.lock().unwrap().iter().map(|rgb| u16::from_le_bytes(*rgb.last_chunk().unwrap()).into()).collect()
    }
    /// How it was finished, if it was.
    pub fn ending(&self) -> Option<Ending> {
        *self.ending.lock().unwrap()
    }
}

pub struct FakeSink {
    pub received: Received,
    pub trouble: Trouble,
    pub closes_at: usize,
    pub finish_fails: bool,
}

fn exists() -> SinkError {
    SinkError::Exists { path: "fake".into() }
}

impl Sink for FakeSink {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let index = self.received.count() as usize;
        if self.trouble.strikes(index) {
            return Err(exists());
        }
        if index == self.closes_at {
            return Ok(ControlFlow::Break(()));
        }
        self.received.pictures.lock().unwrap().push(frame.rgb.clone());
        self.received.times_ns.lock().unwrap().push(time_ns);
        Ok(ControlFlow::Continue(()))
    }
    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        *self.received.ending.lock().unwrap() = Some(ending);
        if self.finish_fails { Err(exists()) } else { Ok(()) }
    }
    fn describe(&self) -> String {
        "fake sink".into()
    }
}

/// Waits with its first frame until the camera is through with all of its own.
pub struct GatedSink(pub Arc<AtomicUsize>, pub usize);

impl Sink for GatedSink {
    fn put(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        while self.0.load(Ordering::SeqCst) < self.1 {
            sleep(Duration::from_millis(1));
        }
        Ok(ControlFlow::Continue(()))
    }
    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }
    fn describe(&self) -> String {
        "gated".into()
    }
}

/// Comes live, and counts what was asked of it.
pub struct LiveCamera(pub FakeCamera, pub Arc<AtomicUsize>);

impl Camera for LiveCamera {
    fn info(&self) -> SourceInfo {
        // So slow that no frame is ever late.
        SourceInfo { live: true, period_ns: 3_600_000_000_000, ..self.0.info() }
    }
    fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError> {
        self.1.fetch_add(1, Ordering::SeqCst);
        self.0.next(shot)
    }
}

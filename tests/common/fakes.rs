//! Minimal stages, which fail or stall on request, or run a test's closure.
#![allow(dead_code, missing_docs)]

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::Duration;

use bokehcam::bokeh::{BlurredFrame, Bokeh, BokehError, Job, PassTimes, Picture};
use bokehcam::compute::Backend;
use bokehcam::compute::GpuError;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::optics::CocField;
use bokehcam_live::capture::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::sink::{Ending, Sink, SinkError};
use bokehcam_live::stats::DropCause;

pub const SIZE: (u32, u32) = (6, 4);
pub const PERIOD_NS: u64 = 1_000_000;
pub const NEVER: usize = usize::MAX;
/// Bytes of a picture that the fake blur changes.
pub const BLURRED: usize = 12;

/// Faults of a fake stage, and their frames.
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
    /// Stalls and panics as asked; returns whether this frame fails.
    fn strikes(&self, frame: usize) -> bool {
        sleep(self.stall);
        assert!(self.panics_at != Some(frame), "out of order at frame {frame}");
        self.fails_at == Some(frame)
    }
}

/// Frames filled with the low byte of their number; the last two bytes hold the whole number.
pub struct FakeCamera {
    pub frames: usize,
    pub next: usize,
    pub corrupt_every: usize,
    pub unpaired_every: usize,
    pub frame_data: FrameData,
    pub trouble: Trouble,
}

pub fn fake_camera(frames: usize) -> FakeCamera {
    let trouble = Trouble::default();
    FakeCamera { frames, next: 0, corrupt_every: NEVER, unpaired_every: NEVER, frame_data: FrameData::Color, trouble }
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
            frame_data: self.frame_data,
        }
    }

    fn next(&mut self, shot: FrameBuffers) -> Result<Captured, CaptureError> {
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
        if index % self.unpaired_every == self.unpaired_every - 1 {
            return Ok(Captured::Lost(1, DropCause::Unpaired));
        }
        let FrameBuffers { color, depth, right } = shot;
        color.resize(SIZE.0, SIZE.1);
        color.rgb.fill(index as u8);
        color.rgb.last_chunk_mut::<2>().unwrap().copy_from_slice(&(index as u16).to_le_bytes());
        if self.frame_data == FrameData::Depth {
            depth.resize(SIZE.0, SIZE.1);
            depth.metres.fill(1.0 + index as f32);
        }
        if self.frame_data == FrameData::RightCamera {
            right.resize(SIZE.0, SIZE.1);
            right.luma.fill(index as u8);
        }
        Ok(Captured::Frame(Stamp { index, time_ns: index as u64 * PERIOD_NS, captured_ns: None }))
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let from = self.next;
        self.next = (until_ns.div_ceil(PERIOD_NS) as usize).clamp(from, self.frames);
        (self.next - from) as u64
    }
}

struct CameraBy<F>(SourceInfo, usize, F);

impl<F: FnMut(usize, FrameBuffers) -> Captured + Send> Camera for CameraBy<F> {
    fn info(&self) -> SourceInfo {
        self.0.clone()
    }
    fn next(&mut self, shot: FrameBuffers) -> Result<Captured, CaptureError> {
        let asked = self.1;
        self.1 += 1;
        Ok((self.2)(asked, shot))
    }
}

/// Creates a camera whose results come from `next`, given the number of earlier calls.
pub fn camera_by(
    info: SourceInfo,
    next: impl FnMut(usize, FrameBuffers) -> Captured + Send + 'static,
) -> Box<dyn Camera> {
    Box::new(CameraBy(info, 0, next))
}

struct DepthBy<F>(F);

impl<F: FnMut(FrameInput, &mut DepthMap) -> Result<(), DepthError> + Send> DepthSource for DepthBy<F> {
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        map.resize(SIZE.0, SIZE.1);
        (self.0)(seen, map)
    }
}

/// Creates a depth source from a closure.
pub fn depth_by(
    read: impl FnMut(FrameInput, &mut DepthMap) -> Result<(), DepthError> + Send + 'static,
) -> Box<dyn DepthSource> {
    Box::new(DepthBy(read))
}

/// Creates a depth source that gives 1 m plus the frame's number, with a hole.
pub fn fake_depth(trouble: Trouble) -> Box<dyn DepthSource> {
    depth_by(move |FrameInput { stamp, .. }, map| {
        let index = stamp.index;
        if trouble.strikes(index) {
            return Err(DepthError::NoDepth { source_name: format!("frame {index}") });
        }
        map.metres.fill(1.0 + index as f32);
        map.metres[3] = 0.0;
        Ok(())
    })
}

/// Holds up to `capacity` frames.
pub struct FakeBokeh {
    pub capacity: usize,
    pub backend: Backend,
    pub name: &'static str,
    pub held: VecDeque<Job>,
    pub submitted: usize,
    pub trouble: Trouble,
    pub collect_fails: bool,
    pub gives_back: bool,
    pub loses_frames: bool,
    /// Called with each frame as it is submitted.
    pub looks: Box<dyn FnMut(&Job) + Send>,
    /// Makes the result from a frame.
    pub makes: Box<dyn FnMut(Job) -> BlurredFrame + Send>,
}

/// Adds 100 to the first bytes of a picture, and sets the first one to the focus distance where there is one.
pub fn fake_bokeh(capacity: usize, trouble: Trouble) -> FakeBokeh {
    FakeBokeh {
        capacity,
        backend: Backend::Cpu,
        name: "cpu, fake",
        held: VecDeque::new(),
        submitted: 0,
        trouble,
        collect_fails: false,
        gives_back: false,
        loses_frames: false,
        looks: Box::new(|_| {}),
        makes: Box::new(brightened),
    }
}

fn brightened(job: Job) -> BlurredFrame {
    let mut times = PassTimes::new();
    times.add("rows", Duration::from_micros(400));
    times.add("columns", Duration::from_micros(300));
    changed(job, times, |job| {
        job.out.rgb[..BLURRED].iter_mut().for_each(|byte| *byte = byte.wrapping_add(100));
        if let CocField::Depth(coc) = job.coc {
            let map = job.depth.as_ref().expect("dof has depth");
            assert!(map.metres.iter().all(|&z_m| z_m == map.metres[0]), "holes are filled");
            job.out.rgb[0] = coc.focus_m.round() as u8;
        }
    })
}

/// Returns the frame itself, with the changes that `change` makes.
pub fn changed(mut job: Job, times: PassTimes, change: impl FnOnce(&mut Job)) -> BlurredFrame {
    job.out.resize(job.color.width, job.color.height);
    job.out.rgb.copy_from_slice(&job.color.rgb);
    change(&mut job);
    let Job { ticket, out, color, depth, .. } = job;
    BlurredFrame { ticket, picture: Picture::from_memory(out), color, depth, times }
}

impl Bokeh for FakeBokeh {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        assert!(self.held.len() < self.capacity, "submitted beyond the capacity");
        let index = self.submitted;
        self.submitted += 1;
        if self.trouble.strikes(index) && !self.collect_fails {
            return Err(GpuError::Failed("lost".into()).into());
        }
        (self.looks)(&job);
        self.held.push_back(job);
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        if self.collect_fails && self.trouble.fails_at.is_some_and(|frame| self.submitted > frame) {
            return Err(GpuError::Failed("lost".into()).into());
        }
        if self.loses_frames || !wait && self.held.len() < self.capacity {
            return Ok(None);
        }
        Ok(self.held.pop_front().map(&mut self.makes))
    }

    fn reclaim_job(&mut self) -> Option<Job> {
        if self.gives_back { self.held.pop_front() } else { None }
    }
    fn in_flight(&self) -> usize {
        self.held.len()
    }
    fn capacity(&self) -> usize {
        self.capacity
    }
    fn backend(&self) -> Backend {
        self.backend
    }
    fn describe(&self) -> String {
        self.name.into()
    }
}

/// Everything that a sink received, readable by the test.
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
    /// Returns how the sink was finished, if it was.
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

pub fn fake_sink(received: &Received) -> FakeSink {
    FakeSink { received: received.clone(), trouble: Trouble::default(), closes_at: NEVER, finish_fails: false }
}

fn exists() -> SinkError {
    SinkError::Exists { path: "fake".into() }
}

impl Sink for FakeSink {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
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

struct SinkBy<F>(bool, F);

impl<F: FnMut(&ColorImage) + Send> Sink for SinkBy<F> {
    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        (self.1)(frame);
        Ok(ControlFlow::Continue(()))
    }
    fn has_outputs(&self) -> bool {
        self.0
    }
}

/// Creates a sink that calls `write` with each frame.
pub fn sink_by(write: impl FnMut(&ColorImage) + Send + 'static) -> Box<dyn Sink> {
    Box::new(SinkBy(true, write))
}

/// Creates a sink that accepts frames and reports that it has no viewers.
pub fn nobody() -> Box<dyn Sink> {
    Box::new(SinkBy(false, |_: &ColorImage| {}))
}

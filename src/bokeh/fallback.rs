//! Switches to another executor (the CPU) when the GPU fails, from the oldest frame in flight on.

use std::collections::VecDeque;
use std::sync::Arc;

use super::{BlurredFrame, Bokeh, BokehError, Job};
use crate::compute::with_fallback::WithFallback;
use crate::compute::{Backend, Device, GpuError};

/// Makes the fallback executor.
pub type MakeFallback = Box<dyn FnOnce() -> Box<dyn Bokeh> + Send>;

/// Runs one executor until its GPU fails, then another. No frame is lost: the frames in flight at the failure are
/// blurred again by the other executor.
pub struct Fallback {
    executor: WithFallback<Box<dyn Bokeh>, MakeFallback>,
    /// Frames not yet submitted, oldest first: after a failure there may be more than the fallback accepts.
    waiting: VecDeque<Job>,
}

impl Fallback {
    /// Creates an executor that runs `first`, and the result of `other` once `first` fails.
    pub fn new(first: Box<dyn Bokeh>, other: MakeFallback) -> Self {
        Self { executor: WithFallback::new(first, other), waiting: VecDeque::new() }
    }

    /// Switches to the other executor, or returns the error if that has happened already.
    fn switch_over(&mut self, error: GpuError) -> Result<(), BokehError> {
        let Self { executor, waiting } = self;
        let make = |first: &mut Box<dyn Bokeh>, other: MakeFallback| {
            let mut all: VecDeque<Job> = std::iter::from_fn(|| first.reclaim_job()).collect();
            all.append(waiting);
            *waiting = all;
            // Drops the first executor, and with it its GPU memory, before the other one allocates its own.
            *first = Box::new(Placeholder);
            Ok(other())
        };
        Ok(executor.fall_back(error, "blurs", make)?)
    }

    /// Submits waiting frames while the executor has room.
    fn submit_waiting(&mut self) -> Result<(), BokehError> {
        while self.executor.worker().in_flight() < self.executor.worker().capacity()
            && let Some(job) = self.waiting.pop_front()
        {
            match self.executor.worker_mut().submit(job) {
                Err(BokehError::Gpu(error)) => self.switch_over(error)?,
                done => done?,
            }
        }
        Ok(())
    }
}

impl Bokeh for Fallback {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        self.waiting.push_back(job);
        self.submit_waiting()
    }

    fn collect(&mut self, wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        // After a failure, the next iteration submits the frames to the other executor.
        loop {
            self.submit_waiting()?;
            match self.executor.worker_mut().collect(wait) {
                Err(BokehError::Gpu(error)) => self.switch_over(error)?,
                done => return done,
            }
        }
    }

    fn reclaim_job(&mut self) -> Option<Job> {
        self.executor.worker_mut().reclaim_job().or_else(|| self.waiting.pop_front())
    }

    fn in_flight(&self) -> usize {
        self.executor.worker().in_flight() + self.waiting.len()
    }

    fn capacity(&self) -> usize {
        self.executor.worker().capacity()
    }

    fn backend(&self) -> Backend {
        self.executor.worker().backend()
    }

    fn device(&self) -> Option<Arc<Device>> {
        self.executor.worker().device()
    }

    fn backends(&self) -> &'static str {
        match self.executor.failure() {
            Some(_) => "gpu, then cpu",
            None => self.executor.worker().backends(),
        }
    }

    fn describe(&self) -> String {
        match self.executor.failure() {
            Some(failure) => format!("{failure}; then {}", self.executor.worker().describe()),
            None => self.executor.worker().describe(),
        }
    }
}

/// Placeholder while the first executor is dropped and the other one is made.
struct Placeholder;

impl Bokeh for Placeholder {
    fn submit(&mut self, _: Job) -> Result<(), BokehError> {
        Ok(())
    }

    fn collect(&mut self, _: bool) -> Result<Option<BlurredFrame>, BokehError> {
        Ok(None)
    }

    fn in_flight(&self) -> usize {
        0
    }

    fn capacity(&self) -> usize {
        0
    }

    fn backend(&self) -> Backend {
        Backend::Cpu
    }

    fn describe(&self) -> String {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::PassTimes;
    use crate::bokeh::Picture;

    use crate::frame::ColorImage;
    use crate::link::pool::Pool;
    use crate::optics::CocField;

    /// Test executor that writes its mark into the pictures; fails at step `fails_at`, where submitting and collecting
    /// are steps.
    struct Marks {
        mark: u8,
        capacity: usize,
        jobs: VecDeque<Job>,
        fails_at: u32,
        steps: u32,
    }

    impl Marks {
        fn new(mark: u8, capacity: usize, fails_at: u32) -> Self {
            Self { mark, capacity, jobs: VecDeque::new(), fails_at, steps: 0 }
        }

        fn step(&mut self) -> Result<(), BokehError> {
            self.steps += 1;
            if self.steps < self.fails_at { Ok(()) } else { Err(GpuError::Failed("it is lost".to_owned()).into()) }
        }
    }

    impl Bokeh for Marks {
        fn submit(&mut self, job: Job) -> Result<(), BokehError> {
            assert!(self.jobs.len() < self.capacity);
            if matches!(job.coc, CocField::Depth(_)) {
                return Err(BokehError::NoDepth);
            }
            self.jobs.push_back(job);
            self.step()
        }

        fn collect(&mut self, _: bool) -> Result<Option<BlurredFrame>, BokehError> {
            if self.jobs.is_empty() {
                return Ok(None);
            }
            self.step()?;
            let Some(Job { ticket, color, depth, mut out, .. }) = self.jobs.pop_front() else { return Ok(None) };
            out.rgb.fill(self.mark);
            let picture = Picture::from_memory(out);
            Ok(Some(BlurredFrame { ticket, picture, color, depth, times: PassTimes::new() }))
        }

        fn reclaim_job(&mut self) -> Option<Job> {
            self.jobs.pop_front()
        }

        fn in_flight(&self) -> usize {
            self.jobs.len()
        }

        fn capacity(&self) -> usize {
            self.capacity
        }

        fn backend(&self) -> Backend {
            if self.capacity > 1 { Backend::Gpu } else { Backend::Cpu }
        }

        fn describe(&self) -> String {
            if self.capacity > 1 { "a GPU" } else { "cpu, marks" }.to_owned()
        }
    }

    fn job(ticket: u64, pool: &Pool<ColorImage>, coc: CocField) -> Job {
        Job { ticket, out: pool.take(), ..Job::new(pool.take(), None, coc) }
    }

    const UNIFORM: CocField = CocField::Uniform { radius_px: 1.0 };

    #[test]
    fn every_frame_is_blurred_once_and_in_order_wherever_the_gpu_fails() {
        const FRAMES: u64 = 10;
        for fails_at in 1..=2 * FRAMES as u32 + 1 {
            // No more buffers than may be out at once.
            let pool = Pool::new(2 * 4, || ColorImage::new(2, 2));
            let other = Box::new(|| Box::new(Marks::new(2, 1, u32::MAX)) as Box<dyn Bokeh>);
            let mut bokeh = Fallback::new(Box::new(Marks::new(1, 3, fails_at)), other);
            assert_eq!((bokeh.backends(), bokeh.describe().as_str()), ("gpu", "a GPU"));
            let (mut submitted, mut marks) = (0, Vec::new());
            while (marks.len() as u64) < FRAMES {
                if submitted < FRAMES && bokeh.in_flight() < bokeh.capacity() {
                    bokeh.submit(job(submitted, &pool, UNIFORM)).unwrap();
                    submitted += 1;
                } else {
                    let finished = bokeh.collect(true).unwrap().expect("something is in flight");
                    assert_eq!(finished.ticket, marks.len() as u64);
                    marks.push(finished.picture.memory().unwrap().rgb[0]);
                }
            }
            assert_eq!((bokeh.in_flight(), pool.free()), (0, 8), "nothing is left behind");
            assert!(marks.is_sorted(), "first the GPU, then the CPU: {marks:?}");
            let failed = fails_at <= 2 * FRAMES as u32;
            assert_eq!(marks.contains(&2), failed, "{fails_at}");
            let ran = if failed { ("gpu, then cpu", "GPU: it is lost; then cpu, marks") } else { ("gpu", "a GPU") };
            assert_eq!((bokeh.backends(), bokeh.describe().as_str()), ran);
        }
    }

    #[test]
    fn what_is_wrong_with_a_frame_is_not_the_gpus_fault() {
        let pool = Pool::new(2, || ColorImage::new(2, 2));
        let other = Box::new(|| -> Box<dyn Bokeh> { panic!("nobody asks for it") });
        let mut bokeh = Fallback::new(Box::new(Marks::new(1, 3, u32::MAX)), other);
        let coc = CocField::Depth(crate::optics::DepthCoc {
            coc_at_infinity_px: 1.0,
            focus_m: 1.0,
            range_m: 0.0,
            max_coc_px: 1.0,
        });
        assert!(matches!(bokeh.submit(job(0, &pool, coc)), Err(BokehError::NoDepth)));
    }
}

//! Measurements for the instruments: recent frames, stage times, and drop counts.

use std::collections::VecDeque;

use bokehcam::budget::{Quality, Window};
use bokehcam::pipeline::{Trace, View};
use bokehcam::stats::{FrameCounts, Histogram};

/// Number of recent frames that the meters keep.
pub const GRAPH_FRAMES: usize = 240;
/// Milliseconds per nanosecond.
const MS_PER_NS: f64 = 1e-6;
/// Weight of a new frame in the exponential moving averages, low enough that single outliers do not show.
const SMOOTHING: f64 = 0.08;

/// One frame in the graph.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameSample {
    /// Duration of its blur, in milliseconds.
    pub blur_ms: f32,
    /// Time since the previously presented frame, in milliseconds; 0 for the first frame.
    pub interval_ms: f32,
    /// Quality level of the blur; `None` if the frame was not blurred.
    pub quality: Option<Quality>,
}

/// Statistics of the recent frames, and totals of the whole run.
#[derive(Clone, Debug, Default)]
pub struct Meters {
    /// The last [`GRAPH_FRAMES`] frames, oldest first.
    samples: VecDeque<FrameSample>,
    latency_ms: Window<GRAPH_FRAMES>,
    reaction_ms: Window<GRAPH_FRAMES>,
    /// Moving averages of the stage times.
    pub stages: Stages,
    /// Captured and dropped frames of the source.
    pub frames: FrameCounts,
    /// Time of the last presented frame; `None` before the first.
    last_presented_ns: Option<u64>,
    /// Start of the preview.
    started_ns: Option<u64>,
    /// Totals since the start of the preview.
    pub totals: Totals,
}

/// Exponential moving averages of the stage times, in milliseconds.
#[derive(Clone, Debug, Default)]
pub struct Stages {
    pub decode_ms: f64,
    pub depth_ms: f64,
    pub blur_ms: f64,
    /// Queueing time between the stages, including the delivery to the screen.
    pub queueing_ms: f64,
    pub playout_ms: f64,
    pub present_ms: f64,
    /// Fraction of the frames with a newly estimated depth map.
    fresh_depth_fraction: f64,
    /// Times of the blur's passes, by name.
    pub passes: Vec<(&'static str, f64)>,
}

impl Stages {
    /// Returns how many frames share one depth map, at least 1.
    pub fn depth_interval(&self) -> u32 {
        if self.fresh_depth_fraction > 0.0 { self.fresh_depth_fraction.recip().round() as u32 } else { 1 }
    }
}

/// Totals since the start of the preview.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    pub presented: u64,
    /// Time from the start of the preview to the first presented frame, in nanoseconds.
    pub first_frame_ns: Option<u64>,
    /// Latency from capture to the end of presenting.
    pub latency: Histogram,
    /// Latency from an input to the first picture that shows its effect.
    pub reaction: Histogram,
    pub present: Histogram,
}

/// Numbers for the instruments over the last [`GRAPH_FRAMES`] frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Presented frames per second.
    pub fps: f64,
    /// Median and 99th percentile of the latency from capture to the end of presenting, in milliseconds.
    pub latency_ms: [f64; 2],
    /// Median and 99th percentile of the latency from input to picture, in milliseconds.
    pub reaction_ms: [f64; 2],
}

impl Meters {
    /// Sets the start of the preview, from which the time to the first frame counts. Later calls have no effect.
    pub fn set_start(&mut self, now_ns: u64) {
        self.started_ns.get_or_insert(now_ns);
    }

    /// Clears the recent frames for a new source; totals remain.
    pub fn clear_recent(&mut self) {
        let (started_ns, totals) = (self.started_ns, std::mem::take(&mut self.totals));
        *self = Self { started_ns, totals, ..Self::default() };
    }

    /// Records a frame presented at `now_ns` (run clock), where presenting took `present_ns`. Does not allocate.
    pub fn add_frame(&mut self, view: &View, now_ns: u64, present_ns: u64) {
        let latency_ns = now_ns.saturating_sub(view.captured_ns);
        self.record_times(&view.trace, now_ns, latency_ns, present_ns);
        self.frames = view.frames;
    }

    /// Adds a presented frame to the totals, the graph and the means.
    fn record_times(&mut self, trace: &Trace, now_ns: u64, latency_ns: u64, present_ns: u64) {
        self.totals.presented += 1;
        self.totals.latency.add(latency_ns);
        self.totals.present.add(present_ns);
        if let (None, Some(started_ns)) = (self.totals.first_frame_ns, self.started_ns) {
            self.totals.first_frame_ns = Some(now_ns.saturating_sub(started_ns));
        }
        let last_ns = self.last_presented_ns.replace(now_ns);
        let interval_ms = last_ns.map(|last_ns| now_ns.saturating_sub(last_ns) as f64 * MS_PER_NS);
        self.latency_ms.push(latency_ns as f64 * MS_PER_NS);
        self.stages.update(trace, (latency_ns, present_ns), self.samples.is_empty());
        if self.samples.len() == GRAPH_FRAMES {
            self.samples.pop_front();
        }
        // Reserves the full capacity on the first frame, so that later frames never allocate.
        self.samples.reserve(GRAPH_FRAMES - self.samples.len());
        self.samples.push_back(FrameSample {
            blur_ms: (trace.blur_ns as f64 * MS_PER_NS) as f32,
            interval_ms: interval_ms.unwrap_or_default() as f32,
            quality: trace.quality,
        });
    }

    /// Records the latency from an input to its effect on the screen.
    pub fn add_reaction(&mut self, after_ns: u64) {
        self.totals.reaction.add(after_ns);
        self.reaction_ms.push(after_ns as f64 * MS_PER_NS);
    }

    /// Fills the meters with a plausible run, for screenshots of the instruments.
    #[cfg(test)]
    pub fn fill_with_samples(&mut self) {
        let rungs = [Quality::Balanced, Quality::High, Quality::Fast, Quality::Balanced];
        for k in 0..300u64 {
            let mut passes = bokehcam::bokeh::PassTimes::new();
            for (name, us) in [("bin", 3100), ("fill", 800), ("reach", 450), ("blur", 9400), ("composite", 3600)] {
                passes.add(name, std::time::Duration::from_micros(us));
            }
            let wave = 4.0 * (k as f64 / 9.0).sin() + 3.0 * (k as f64 / 2.3).sin();
            let blur_ms = 20.0 + wave + if k % 97 == 3 { 22.0 } else { 0.0 };
            let quality = Some(rungs[(k / 80) as usize % rungs.len()]);
            let trace = Trace {
                decode_ns: 4_100_000,
                depth_ns: 6_300_000,
                blur_ns: (blur_ms * 1e6) as u64,
                passes,
                quality,
                is_depth_reused: k % 2 == 1,
                queueing_ns: 3_000_000,
                playout_ns: 4_000_000,
                ..Trace::default()
            };
            self.record_times(&trace, k * 33_400_000, 41_000_000 + k * 20_000, 1_900_000);
        }
        self.add_reaction(24_000_000);
        self.frames.captured = 300;
        self.frames.dropped.late = 2;
        self.frames.dropped.evicted = 5;
        self.frames.dropped.driver = 112;
        self.frames.dropped.unpaired = 31;
    }

    /// Returns the recent frames, oldest first.
    pub fn samples(&self) -> impl ExactSizeIterator<Item = &FrameSample> {
        self.samples.iter()
    }

    /// Computes the summary of the recent frames. It sorts, so call it only a few times per second.
    pub fn summary(&self) -> Summary {
        let spread = |window: &Window<GRAPH_FRAMES>| [0.5, 0.99].map(|p| window.percentile(GRAPH_FRAMES, p));
        // The first frame has no interval: it is 0.
        let intervals = self.samples().map(|sample| f64::from(sample.interval_ms)).filter(|&ms| ms > 0.0);
        let (count, sum_ms) = intervals.fold((0.0, 0.0), |(count, sum), ms| (count + 1.0, sum + ms));
        Summary {
            fps: if sum_ms > 0.0 { 1000.0 * count / sum_ms } else { 0.0 },
            latency_ms: spread(&self.latency_ms),
            reaction_ms: spread(&self.reaction_ms),
        }
    }
}

impl Stages {
    /// Updates the averages with the times of a frame; the first frame initialises them.
    fn update(&mut self, trace: &Trace, (latency_ns, present_ns): (u64, u64), first: bool) {
        let weight = if first { 1.0 } else { SMOOTHING };
        let ease = |mean_ms: &mut f64, ns: u64| *mean_ms += (ns as f64 * MS_PER_NS - *mean_ms) * weight;
        let to_screen_ns = latency_ns.saturating_sub(trace.age_ns + present_ns);
        ease(&mut self.queueing_ms, trace.queueing_ns + to_screen_ns);
        ease(&mut self.playout_ms, trace.playout_ns);
        self.fresh_depth_fraction += (f64::from(u8::from(!trace.is_depth_reused)) - self.fresh_depth_fraction) * weight;
        ease(&mut self.decode_ms, trace.decode_ns);
        ease(&mut self.depth_ms, trace.depth_ns);
        ease(&mut self.blur_ms, trace.blur_ns);
        ease(&mut self.present_ms, present_ns);
        for (name, time) in trace.passes.iter() {
            let ms = time.as_secs_f64() * 1e3;
            match self.passes.iter_mut().find(|pass| pass.0 == name) {
                Some(pass) => pass.1 += (ms - pass.1) * weight,
                None => self.passes.push((name, ms)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 40_000_000;

    fn meters_after(frames: u64) -> Meters {
        let mut meters = Meters::default();
        meters.set_start(1_000);
        for k in 0..frames {
            let trace = Trace { blur_ns: 1_000_000 * k, quality: Some(Quality::Fast), ..Trace::default() };
            meters.record_times(&trace, 1_000 + (k + 1) * PERIOD_NS, 5_000_000 + k * 1_000, 2_000_000);
        }
        meters
    }

    #[test]
    fn the_last_frames_are_held_oldest_first() {
        for frames in [0, 1, 7, GRAPH_FRAMES as u64, 3 * GRAPH_FRAMES as u64 + 5] {
            let meters = meters_after(frames);
            let held = frames.min(GRAPH_FRAMES as u64);
            let blurs: Vec<f32> = meters.samples().map(|sample| sample.blur_ms).collect();
            assert_eq!(blurs.len() as u64, held);
            assert!(blurs.iter().zip(frames - held..).all(|(&ms, k)| (ms - k as f32).abs() < 1e-3), "{blurs:?}");
        }
    }

    #[test]
    fn rates_and_percentiles_are_those_of_the_frames() {
        let meters = meters_after(100);
        let summary = meters.summary();
        assert!((summary.fps - 25.0).abs() < 1e-3, "{summary:?}");
        assert!((summary.latency_ms[0] - 5.049).abs() < 2e-3 && (summary.latency_ms[1] - 5.098).abs() < 2e-3);
        assert_eq!(summary.reaction_ms, [0.0; 2]);
        let totals = meters.totals;
        assert_eq!((totals.presented, totals.first_frame_ns), (100, Some(PERIOD_NS)));
        assert_eq!(Meters::default().summary(), Summary::default());
    }

    #[test]
    fn another_source_begins_anew_but_totals_go_on() {
        let mut meters = meters_after(10);
        meters.add_reaction(9_000_000);
        meters.clear_recent();
        assert_eq!((meters.samples().len(), meters.summary()), (0, Summary::default()));
        assert_eq!((meters.totals.presented, meters.totals.reaction.samples()), (10, 1));
        meters.record_times(&Trace::default(), 10 * PERIOD_NS, 1, 1);
        assert_eq!(meters.totals.first_frame_ns, Some(PERIOD_NS), "the first frame is the first of all");
    }

    #[test]
    fn stages_follow_the_frames() {
        let mut meters = meters_after(400);
        assert!((meters.stages.present_ms - 2.0).abs() < 1e-9);
        let mut passes = bokehcam::bokeh::PassTimes::new();
        passes.add("blur", std::time::Duration::from_millis(7));
        meters.record_times(&Trace { passes, ..Trace::default() }, 1, 1, 1);
        assert_eq!(meters.stages.passes, [("blur", 7.0)]);
    }

    #[test]
    fn the_stages_and_waits_make_up_the_latency_and_depth_counts_as_often_as_it_is_made() {
        for every in 1..=3 {
            let mut meters = Meters::default();
            for k in 0..200 {
                let depth_ns = if k % every == 0 { 30_000_000 } else { 1_000_000 };
                let trace = Trace {
                    depth_ns,
                    age_ns: depth_ns + 20_000_000,
                    is_depth_reused: k % every > 0,
                    blur_ns: 9_000_000,
                    queueing_ns: 4_000_000,
                    playout_ns: 7_000_000,
                    ..Trace::default()
                };
                // 3 ms from the pipeline to the window, and 2 ms to present.
                meters.record_times(&trace, k * PERIOD_NS, trace.age_ns + 5_000_000, 2_000_000);
            }
            let stages = meters.stages;
            let parts = [stages.depth_ms, stages.blur_ms, stages.queueing_ms, stages.playout_ms, stages.present_ms];
            let depth_ms = 1.0 + 29.0 / every as f64;
            assert!((stages.queueing_ms - 7.0).abs() < 1e-6, "{stages:?}");
            let sum_ms = parts.iter().sum::<f64>();
            assert!((sum_ms - (depth_ms + 25.0)).abs() < 1.5, "{every}: {sum_ms}");
            assert_eq!(u64::from(stages.depth_interval()), every);
        }
    }
}

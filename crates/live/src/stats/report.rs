//! The report of a run, as JSON for measurements.

use std::io;

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::{FrameCounts, Histogram, NodeCounts, OutputCounts, Timings};

/// The parts of a run, after all defaults were resolved.
#[derive(Clone, Debug, Default)]
pub struct RunInfo {
    /// The source of the frames.
    pub source: String,
    /// Their destination.
    pub sink: String,
    /// Time that a frame's blur may take, in nanoseconds.
    pub budget_ns: u64,
    /// Wall time of the run, in nanoseconds.
    pub elapsed_ns: u64,
    /// CPU time of the program meanwhile, in nanoseconds.
    pub cpu_ns: u64,
    /// Energy of the processor meanwhile, other programs included, in joules; or why it is unknown.
    pub energy_j: Option<Result<f64, String>>,
    /// The outputs, if there are several.
    pub outputs: Vec<OutputCounts>,
    /// The PipeWire cameras.
    pub pipewire: Vec<NodeCounts>,
    /// The source, if its frames arrive at their own pace.
    pub live: Option<LiveSource>,
}

/// A source whose frames arrive at their own pace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveSource {
    /// Width and height of its frames, in pixels.
    pub size: (u32, u32),
    /// Frames per second.
    pub fps: f64,
}

/// The report (`--report`). Times are in milliseconds.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Counts of all frames, by fate.
    pub frames: FrameCounts,
    /// Time from capture to delivery.
    pub latency_ms: Option<Percentiles>,
    /// Time from one delivery to the next.
    pub frame_ms: Option<Percentiles>,
    /// Times per stage, and per pass of the blur as `blur.PASS`.
    pub stages_ms: StagesMs,
    /// The quality levels used.
    pub quality: QualityStats,
    /// Time that a frame's blur may take.
    pub budget_ms: f64,
    /// Frames whose blur took longer.
    pub misses: u64,
    /// Frames that reused the depth of an earlier one, warped with the picture, to save time.
    pub depth_held: u64,
    /// How often a live output was sent its last picture again because no new one came.
    pub repeats: u64,
    /// `cpu`, `gpu` or `none`.
    pub backend: String,
    /// The executor of the blur.
    pub adapter: String,
    /// The backend that refined depth: `cpu`, `gpu`, `gpu, then cpu` or `none`.
    pub refined_by: String,
    /// The backend that estimated mattes, with the same values.
    pub matted_by: String,
    /// The source of the frames.
    pub source: String,
    /// Their destination.
    pub sink: String,
    /// Wall time of the run, in seconds.
    pub elapsed_s: f64,
    /// CPU time of the program meanwhile in seconds: all threads, and child processes that have ended, such as ffmpeg.
    pub cpu_s: f64,
    /// Energy of the processor meanwhile, other programs included, in joules.
    pub energy_j: Option<f64>,
    /// Why the energy is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_unknown: Option<String>,
    /// Counts per output, if there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub outputs: Vec<OutputCounts>,
    /// Counts per PipeWire camera.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pipewire: Vec<NodeCounts>,
    /// Measurements of the window, if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<WindowStats>,
    /// The versions that produced this report.
    pub versions: Versions,
    /// The source, if its frames arrive at their own pace.
    #[serde(skip)]
    pub live: Option<LiveSource>,
}

/// Frames that a window showed, and their latencies.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct WindowStats {
    /// Frames shown on the screen.
    pub presented: u64,
    /// Time from the start of the preview to its first frame.
    pub first_frame_ms: Option<f64>,
    /// Time from capture to the screen.
    pub latency_ms: Option<Percentiles>,
    /// Time from an input to the picture that shows its effect.
    pub reaction_ms: Option<Percentiles>,
    /// Time to draw a frame with its controls and to present it.
    pub present_ms: Option<Percentiles>,
}

impl WindowStats {
    /// Summarises the measurements of a window.
    pub fn new(presented: u64, first_frame_ns: Option<u64>, [latency, reaction, present]: [&Histogram; 3]) -> Self {
        Self {
            presented,
            first_frame_ms: first_frame_ns.map(to_ms),
            latency_ms: Percentiles::from_histogram(latency),
            reaction_ms: Percentiles::from_histogram(reaction),
            present_ms: Percentiles::from_histogram(present),
        }
    }
}

/// Percentiles of a time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// Percentiles of a stage's time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct StageMs {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
}

/// Stage names and times, in the order in which a frame passes them; in JSON an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StagesMs(pub Vec<(String, StageMs)>);

/// The quality levels used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QualityStats {
    /// Fraction of the blurred frames per quality level, summing to 1; in JSON these are members of the object itself.
    pub fractions: Vec<(&'static str, f64)>,
    /// Number of changes of the level.
    pub switches: u64,
}

/// The versions that produced a report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Versions {
    /// The version of this program.
    pub bokehcam: &'static str,
    /// Operating system and CPU architecture.
    pub platform: String,
}

impl Report {
    /// Summarises a run. Frame counts that do not [balance](FrameCounts::is_balanced) are a bug of this program, and
    /// logged.
    pub fn new(frames: FrameCounts, timings: &Timings, info: RunInfo) -> Self {
        if !frames.is_balanced() {
            tracing::error!(?frames, "the frames do not add up: please report this");
        }
        let mut stages = Vec::new();
        let mut stage = |name: String, times: &Histogram| {
            if times.samples() > 0 {
                stages.push((
                    name,
                    StageMs { p50: to_ms(times.percentile_ns(0.5)), p99: to_ms(times.percentile_ns(0.99)) },
                ));
            }
        };
        stage("decode".into(), &timings.decode);
        stage("depth".into(), &timings.depth.took);
        stage("blur".into(), &timings.blur.took);
        for (name, times) in timings.blur.passes.iter() {
            stage(format!("blur.{name}"), times);
        }
        stage("playout".into(), &timings.sink.playout);
        stage("sink".into(), &timings.sink.took);
        let [backend, adapter] = timings.blur.by.clone();
        let by = |by: Option<&str>| by.unwrap_or("none").to_owned();
        Self {
            frames,
            latency_ms: Percentiles::from_histogram(&timings.sink.latency),
            frame_ms: Percentiles::from_histogram(&timings.sink.frame),
            stages_ms: StagesMs(stages),
            quality: timings.blur.quality_counts.fractions(),
            budget_ms: to_ms(info.budget_ns),
            misses: timings.blur.misses,
            depth_held: timings.depth.reused,
            repeats: timings.sink.repeats + info.outputs.iter().map(|output| output.repeats).sum::<u64>(),
            backend,
            adapter,
            refined_by: by(timings.depth.refined_by),
            matted_by: by(timings.depth.matted_by),
            source: info.source,
            sink: info.sink,
            elapsed_s: to_ms(info.elapsed_ns) / 1000.0,
            cpu_s: to_ms(info.cpu_ns) / 1000.0,
            energy_j: info.energy_j.as_ref().and_then(|energy_j| energy_j.as_ref().ok().copied()),
            energy_unknown: info.energy_j.and_then(Result::err),
            outputs: info.outputs,
            pipewire: info.pipewire,
            window: None,
            versions: Versions {
                bokehcam: env!("CARGO_PKG_VERSION"),
                platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            },
            live: info.live,
        }
    }

    /// Writes the report as JSON with a final line break.
    ///
    /// # Errors
    /// Writing failed.
    pub fn write_json(&self, mut to: impl io::Write) -> io::Result<()> {
        serde_json::to_writer_pretty(&mut to, self)?;
        to.write_all(b"\n")
    }
}

/// Returns milliseconds, rounded to three decimals, as the histograms are no more precise.
fn to_ms(time_ns: u64) -> f64 {
    (time_ns as f64 / 1e3).round() / 1e3
}

impl Percentiles {
    fn from_histogram(times: &Histogram) -> Option<Self> {
        let p = |p| to_ms(times.percentile_ns(p));
        (times.samples() > 0).then(|| Self { p50: p(0.5), p95: p(0.95), p99: p(0.99), max: to_ms(times.max_ns()) })
    }
}

impl Serialize for StagesMs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, times)| (name, times)))
    }
}

impl Serialize for QualityStats {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.fractions.len() + 1))?;
        for (level, fraction) in &self.fractions {
            map.serialize_entry(level, fraction)?;
        }
        map.serialize_entry("switches", &self.switches)?;
        map.end()
    }
}

#[cfg(test)]
mod tests;

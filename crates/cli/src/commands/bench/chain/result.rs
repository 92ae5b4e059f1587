//! The result of `bench --chain`: what the stages cost, and the quality that this machine affords.

use std::fmt::Write;

use serde::Serialize;

use bokehcam::compute::thread_pool::core_count;

/// Frame rates for which the finest affordable quality is reported.
const RATES: [u32; 2] = [30, 60];

/// Processor time of all threads, and wall time, in milliseconds: medians over the frames.
#[derive(Clone, Copy, Default, Serialize)]
pub(super) struct Cost {
    pub(super) cpu_ms: f64,
    pub(super) wall_ms: f64,
}

/// A stage, or a step of one.
#[derive(Serialize)]
pub(super) struct Stage {
    pub(super) name: &'static str,
    /// Name of the thread. Threads work on successive frames in parallel; the steps of one thread run in sequence.
    pub(super) thread: &'static str,
    #[serde(flatten)]
    pub(super) cost: Cost,
}

/// Cost of a quality level.
#[derive(Serialize)]
struct Level {
    quality: &'static str,
    blur: Cost,
    /// Processor time of the whole chain.
    cpu_ms: f64,
    /// Frames a second, limited by the slowest thread and by all cores together.
    frames_per_s: f64,
}

/// Result for one source.
#[derive(Serialize)]
pub(super) struct Chain {
    source: String,
    size_px: (u32, u32),
    executor: String,
    cores: usize,
    frames: u32,
    stages: Vec<Stage>,
    levels: Vec<Level>,
    /// Energy of the processor per frame, all levels together and other programs included, in millijoules.
    energy_mj: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    energy_unknown: Option<String>,
    /// The finest quality level that sustains each frame rate, `None` if none does.
    affords: Vec<(u32, Option<&'static str>)>,
}

impl Chain {
    /// Sums up the stages, of which those of the thread `blur` are the quality levels.
    pub(super) fn new(
        (source, size_px, executor, frames): (String, (u32, u32), String, u32),
        mut stages: Vec<Stage>,
        energy_mj: Result<f64, String>,
    ) -> Self {
        let (blurs, rest) = stages.drain(..).partition::<Vec<_>, _>(|stage| stage.thread == "blur");
        let cores = core_count();
        let cpu_ms: f64 = rest.iter().map(|stage| stage.cost.cpu_ms).sum();
        let thread_ms = |thread: &str| -> f64 {
            rest.iter().filter(|stage| stage.thread == thread).map(|stage| stage.cost.wall_ms).sum()
        };
        // Throughput of a pipeline: its slowest thread, or all of its work over all cores.
        let slowest_ms = ["capture", "depth", "sink"].into_iter().map(thread_ms).fold(0.0, f64::max);
        let level = |stage: &Stage| {
            let (blur, cpu_ms) = (stage.cost, cpu_ms + stage.cost.cpu_ms);
            let period_ms = slowest_ms.max(blur.wall_ms).max(cpu_ms / cores as f64);
            Level { quality: stage.name, blur, cpu_ms, frames_per_s: 1e3 / period_ms }
        };
        let levels: Vec<Level> = blurs.iter().map(level).collect();
        let finest = |rate: u32| levels.iter().rev().find(|level| level.frames_per_s >= f64::from(rate));
        let affords = RATES.map(|rate| (rate, finest(rate).map(|level| level.quality))).to_vec();
        let (energy_mj, energy_unknown) = match energy_mj {
            Ok(energy_mj) => (Some(energy_mj), None),
            Err(reason) => (None, Some(reason)),
        };
        Self { source, size_px, executor, cores, frames, stages: rest, levels, energy_mj, energy_unknown, affords }
    }

    /// Returns the table for people.
    pub(super) fn format_table(&self) -> String {
        let Self { source, size_px: (width, height), executor, cores, frames, stages, levels, affords, .. } = self;
        let mut text = format!("{source}, {width}x{height}, {frames} frames; {executor}; {cores} cores\n\n");
        text += "thread    stage           processor ms   wall ms\n";
        for Stage { name, thread, cost } in stages.iter().filter(|stage| stage.thread != "sink") {
            let _ = writeln!(text, "{thread:<9} {name:<16} {:>11.2} {:>9.2}", cost.cpu_ms, cost.wall_ms);
        }
        for Level { quality, blur, .. } in levels {
            let name = format!("blur, {quality}");
            let _ = writeln!(text, "{:<9} {name:<16} {:>11.2} {:>9.2}", "blur", blur.cpu_ms, blur.wall_ms);
        }
        for Stage { name, thread, cost } in stages.iter().filter(|stage| stage.thread == "sink") {
            let _ = writeln!(text, "{thread:<9} {name:<16} {:>11.2} {:>9.2}", cost.cpu_ms, cost.wall_ms);
        }
        text += "\nquality   processor ms   frames/s   of one core at 30/s\n";
        for Level { quality, cpu_ms, frames_per_s, .. } in levels {
            let share = format!("{:.0} %", 3.0 * cpu_ms);
            let _ = writeln!(text, "{quality:<9} {cpu_ms:>12.2} {frames_per_s:>10.1} {share:>21}");
        }
        text.push('\n');
        let _ = match (self.energy_mj, &self.energy_unknown) {
            (Some(energy_mj), _) => {
                writeln!(text, "energy of the processor: {energy_mj:.0} mJ a frame, all of the above")
            }
            (None, reason) => writeln!(text, "energy of the processor: unknown ({})", reason.as_deref().unwrap_or("?")),
        };
        for (rate, level) in affords {
            let _ = match level {
                Some(level) => writeln!(text, "{rate} frames a second: --quality {level}"),
                None => {
                    writeln!(text, "{rate} frames a second: not at any of these; try smaller pictures, or --refine off")
                }
            };
        }
        text
    }
}

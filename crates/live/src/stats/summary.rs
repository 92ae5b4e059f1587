//! The report of a run as a few lines for people.

use std::fmt;

use super::FrameCounts;
use super::report::{LiveSource, Percentiles, Report, StageMs};

/// Width and height that are suggested to a machine that is too slow, in pixels.
const SMALL: (u32, u32) = (640, 480);

impl Report {
    /// Returns the outcome in plain words: how many frames were delivered, and what to do if the machine was too slow.
    /// [`Display`](fmt::Display) has all counts and times.
    pub fn outcome(&self) -> String {
        let FrameCounts { captured, delivered, dropped, .. } = &self.frames;
        let mut text = format!("{delivered} of {captured} frames delivered in {:.2} s", self.elapsed_s);
        let faults =
            [(dropped.corrupt, "damaged"), (dropped.unpaired, "without a counterpart"), (dropped.failed, "failed")];
        for (count, what) in faults.iter().filter(|(count, _)| *count > 0) {
            text += &format!(", {count} {what}");
        }
        let lossy = self.outputs.iter().filter(|output| output.lost > 0).map(ToString::to_string);
        self.describe_slowness().into_iter().chain(lossy).fold(text, |text, line| text + "\n" + &line)
    }

    /// Says how many frames a slow machine showed and what to do, if a live source lost a tenth of them.
    fn describe_slowness(&self) -> Option<String> {
        let FrameCounts { captured, dropped, .. } = &self.frames;
        let lost = dropped.driver + dropped.evicted + dropped.late;
        let LiveSource { size, fps } = self.live.filter(|_| 10 * lost > *captured)?;
        let is_draft = self.quality.fractions.iter().any(|(level, fraction)| *level == "draft" && *fraction > 0.9);
        let remedies = [
            (u64::from(size.0) * u64::from(size.1) > u64::from(SMALL.0) * u64::from(SMALL.1))
                .then(|| format!("--size {}x{}", SMALL.0, SMALL.1)),
            (!is_draft).then(|| "--quality draft".to_owned()),
            Some(format!("--fps {:.0}", (fps / 2.0).max(1.0))),
        ];
        let remedies: Vec<String> = remedies.into_iter().flatten().take(2).collect();
        let shown_fps = fps * (1.0 - lost as f64 / *captured as f64);
        Some(format!(
            "{shown_fps:.0} of {fps:.0} frames a second were shown: this machine is too slow for {}x{}; try {}",
            size.0,
            size.1,
            remedies.join(" or ")
        ))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FrameCounts { captured, delivered, dropped, in_flight } = &self.frames;
        write!(f, "{delivered} of {captured} frames delivered in {:.2} s", self.elapsed_s)?;
        if self.elapsed_s > 0.0 {
            write!(f, " ({:.1} per second)", *delivered as f64 / self.elapsed_s)?;
        }
        for (cause, count) in dropped.by_cause().into_iter().chain([("in flight", *in_flight)]) {
            if count > 0 {
                write!(f, ", {count} {cause}")?;
            }
        }
        if let Some(latency) = &self.latency_ms {
            let Percentiles { p50, p95, p99, max } = latency;
            write!(f, "\nlatency ms: p50 {p50:.1}, p95 {p95:.1}, p99 {p99:.1}, max {max:.1}")?;
        }
        for (name, StageMs { p50, p99 }) in self.stages_ms.0.iter().filter(|stage| !stage.0.contains('.')) {
            write!(f, "\n{name} ms: p50 {p50:.1}, p99 {p99:.1}")?;
            if name == "blur" {
                write!(f, "; budget {:.1}, missed by {} frames ({})", self.budget_ms, self.misses, self.adapter)?;
            }
        }
        if self.quality.switches > 0 {
            let percent = |(level, fraction): &(&str, f64)| format!("{level} {:.0} %", 100.0 * fraction);
            let percents: Vec<String> = self.quality.fractions.iter().map(percent).collect();
            write!(f, "\nquality: {}; {} changes", percents.join(", "), self.quality.switches)?;
        }
        if self.depth_held > 0 {
            write!(f, "\ndepth: {} frames reused that of an earlier frame, to save time", self.depth_held)?;
        }
        if let Some(energy_j) = self.energy_j.filter(|_| *delivered > 0) {
            write!(f, "\nenergy of the processor: {:.3} J a frame", energy_j / *delivered as f64)?;
        }
        // Only outputs that lost frames.
        let mut lossy = self.outputs.iter().filter(|output| output.lost > 0);
        lossy.try_for_each(|output| write!(f, "\n{output}"))?;
        self.pipewire.iter().try_for_each(|node| write!(f, "\n{node}"))
    }
}

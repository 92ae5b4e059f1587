use super::*;
use crate::stats::{DropCause, FrameCounter};

fn report() -> Report {
    let counter = FrameCounter::new();
    let mut timings = Timings::default();
    for frame in 0..10u64 {
        let ticket = counter.count_captured(frame);
        timings.decode.add(2_000_000);
        timings.blur.took.add(12_000_000);
        timings.blur.passes.add("rows", 7_000_000);
        timings.sink.latency.add(30_000_000 + frame);
        counter.count_delivered(ticket);
    }
    for level in ["draft", "balanced", "balanced", "balanced"] {
        timings.blur.quality_counts.add(level);
    }
    counter.count_lost(3, DropCause::Late);
    let info = RunInfo { budget_ns: 33_333_333, elapsed_ns: 500_000_000, cpu_ns: 250_000_000, ..RunInfo::default() };
    Report::new(counter.frame_counts(), &timings, info)
}

#[test]
fn the_json_has_the_documented_form() {
    let mut text = Vec::new();
    report().write_json(&mut text).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&text).unwrap();
    assert_eq!(json["frames"]["captured"], 13);
    assert_eq!(json["frames"]["dropped"]["late"], 3);
    assert_eq!(json["frames"]["in_flight"], 0);
    assert!((json["latency_ms"]["p95"].as_f64().unwrap() - 30.0).abs() < 0.3);
    assert!(json["frame_ms"].is_null(), "nothing measured is not zero");
    assert!((json["stages_ms"]["blur.rows"]["p99"].as_f64().unwrap() - 7.0).abs() < 0.07);
    assert!(json["stages_ms"]["depth"].is_null(), "no stage that did nothing");
    assert_eq!(json["quality"]["balanced"], 0.75);
    assert_eq!(json["quality"]["switches"], 1);
    assert_eq!((&json["budget_ms"], &json["elapsed_s"], &json["cpu_s"]), (&33.333.into(), &0.5.into(), &0.25.into()));
    for key in ["misses", "backend", "adapter", "refined_by", "matted_by", "source", "sink", "versions"] {
        assert!(!json[key].is_null(), "{key}");
    }
}

#[test]
fn the_summary_names_what_was_lost() {
    let text = report().to_string();
    assert!(text.starts_with("10 of 13 frames delivered in 0.50 s (20.0 per second), 3 late\n"), "{text}");
    assert!(!text.contains("blur.rows"));
    assert!(text.ends_with("\nquality: draft 25 %, balanced 75 %; 1 changes"), "{text}");
}

#[test]
fn a_machine_that_is_too_slow_is_named_with_what_to_do() {
    let outcome = |mut report: Report, size, level| {
        report.live = Some(LiveSource { size, fps: 30.0 });
        report.quality.fractions = vec![(level, 1.0)];
        report.outcome()
    };
    assert_eq!(
        outcome(report(), (1280, 720), "balanced"),
        "10 of 13 frames delivered in 0.50 s\n23 of 30 frames a second were shown: this machine is too slow for \
         1280x720; try --size 640x480 or --quality draft"
    );
    assert!(outcome(report(), (640, 480), "draft").ends_with(" for 640x480; try --fps 15"));
    // A recording that is not live, and few losses, ask for nothing.
    assert_eq!(report().outcome(), "10 of 13 frames delivered in 0.50 s");
    let mut few = report();
    (few.frames.captured, few.frames.delivered) = (303, 300);
    assert_eq!(outcome(few, (1280, 720), "balanced").lines().count(), 1);
    let mut faulty = report();
    (faulty.frames.dropped.corrupt, faulty.frames.dropped.late) = (2, 1);
    assert_eq!(faulty.outcome(), "10 of 13 frames delivered in 0.50 s, 2 damaged");
}

#[test]
fn a_run_without_a_frame_and_one_of_one_frame_have_reports() {
    let mut timings = Timings::default();
    let empty = Report::new(FrameCounts::default(), &timings, RunInfo::default());
    let mut text = Vec::new();
    empty.write_json(&mut text).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&text).unwrap();
    assert_eq!((&json["quality"], json["latency_ms"].is_null()), (&serde_json::json!({ "switches": 0 }), true));
    timings.sink.latency.add(5_000_000);
    let latency_ms = Report::new(FrameCounts::default(), &timings, RunInfo::default()).latency_ms;
    assert_eq!(latency_ms, Some(Percentiles { p50: 5.0, p95: 5.0, p99: 5.0, max: 5.0 }));
}

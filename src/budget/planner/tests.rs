use super::*;

const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 33 * MS;
/// The blur's levels draft, balanced, and on a GPU best; and two efforts of depth.
const GPU_COSTS: [f64; 3] = [0.8, 1.0, 2.2];
const LEVEL_COSTS: &[f64] = GPU_COSTS.split_at(BALANCED + 1).0;
const EFFORT_COSTS: [f64; 2] = [0.5, 1.0];
const BALANCED: usize = 1;

fn planner(efforts: &[f64], level_costs: &[f64]) -> Planner {
    Planner::new(PERIOD_NS, Some(PERIOD_NS), efforts, true, level_costs, [BALANCED, BALANCED])
}

/// Simulates frames whose depth at full effort and usual blur take these times in milliseconds. Returns the plans.
fn play(planner: &mut Planner, times_ms: (f64, f64), frames: u64) -> Vec<Plan> {
    play_with_reuse(planner, times_ms, 2.0, frames)
}

/// Same as [`play`], with `held_ms` for reused depth.
fn play_with_reuse(planner: &mut Planner, (depth_ms, blur_ms): (f64, f64), held_ms: f64, frames: u64) -> Vec<Plan> {
    let ns = |ms: f64| (ms * MS as f64) as u64;
    let mut since = usize::MAX;
    (0..frames)
        .map(|frame| {
            let plan = planner.plan();
            let at_ns = frame * PERIOD_NS;
            let is_own = since >= plan.frames;
            since = if is_own { 1 } else { since + 1 };
            let took_ns = if is_own { ns(depth_ms * planner.efforts[plan.effort]) } else { ns(held_ms) };
            let effort = is_own.then_some(plan.effort);
            planner.record_depth(DepthTimes { effort, took_ns, age_ns: 4 * MS, at_ns });
            planner.record_blur(Sample { level: plan.level, took_ns: ns(blur_ms * GPU_COSTS[plan.level]), at_ns });
            plan
        })
        .collect()
}

/// Returns the final plan, and the number of changes after settling.
fn settle(planner: &mut Planner, times_ms: (f64, f64)) -> (Plan, usize) {
    play(planner, times_ms, 300);
    let plans = play(planner, times_ms, 900);
    (plans[899], plans.windows(2).filter(|pair| pair[0] != pair[1]).count())
}

#[test]
fn with_less_time_effort_goes_first_then_the_blur_then_depth_of_its_own() {
    let plan = |frames, effort, level| Plan { frames, effort, level };
    for (depth_ms, blur_ms, expected) in [
        (12.0, 12.0, plan(1, 1, 1)),
        (24.0, 18.0, plan(1, 1, 1)),
        // Together too late: not with less effort.
        (27.0, 22.0, plan(1, 0, 1)),
        (40.0, 20.0, plan(1, 0, 1)),
        (48.0, 25.5, plan(1, 0, 0)),
        // No effort makes depth fast enough for each frame; the blur keeps most of its budget.
        (70.0, 15.0, plan(2, 0, 1)),
        (70.0, 20.0, plan(2, 0, 0)),
        (140.0, 15.0, plan(3, 0, 1)),
        // A blur that is too slow at any level is no reason to reuse depth.
        (10.0, 60.0, plan(1, 1, 0)),
    ] {
        let (found, changes) = settle(&mut planner(&EFFORT_COSTS, LEVEL_COSTS), (depth_ms, blur_ms));
        assert_eq!((found, changes), (expected, 0), "{depth_ms} and {blur_ms} ms");
    }
}

/// A recording of 1280x720 on two cores: depth takes more than a frame's time, the blur half of it.
#[test]
fn a_blur_that_fits_is_not_lowered_where_depth_does_not() {
    for depth_ms in [30.0, 35.0, 60.0, 100.0] {
        let (plan, _) = settle(&mut planner(&[1.0], LEVEL_COSTS), (depth_ms, 15.0));
        assert!(plan.level == BALANCED && plan.frames > 1, "{depth_ms} ms: {plan:?}");
    }
}

/// A frame that is older than two periods is dropped.
#[test]
fn the_blur_is_lowered_where_that_keeps_frames_from_being_dropped() {
    let (plan, _) = settle(&mut planner(&[1.0], LEVEL_COSTS), (43.0, 16.0));
    assert!(plan.level < BALANCED && plan.frames == 2, "{plan:?}");
}

#[test]
fn all_the_time_there_is_is_taken_and_no_more() {
    for (depth_ms, costs) in
        (2..90).step_by(3).flat_map(|depth_ms| [LEVEL_COSTS, &GPU_COSTS].map(|costs| (depth_ms, costs)))
    {
        for blur_ms in (2..60).step_by(3) {
            let times_ms = (f64::from(depth_ms), f64::from(blur_ms));
            let (plan, changes) = settle(&mut planner(&EFFORT_COSTS, costs), times_ms);
            assert!(changes <= 2, "{times_ms:?}: {changes} changes in half a minute");
            let finer = [
                (plan.level + 1 < costs.len()).then_some(Plan { level: plan.level + 1, ..plan }),
                (plan.frames > 1).then(|| Plan { frames: plan.frames - 1, ..plan }),
                (plan.frames == 1 && plan.effort == 0).then_some(Plan { effort: 1, ..plan }),
            ];
            let took = |plan: Plan| (times_ms.0 * EFFORT_COSTS[plan.effort], times_ms.1 * costs[plan.level]);
            for finer in finer.into_iter().flatten() {
                let (depth_ms, blur_ms) = took(finer);
                // Half of its time is guaranteed to each stage; more fits only if both are in time.
                let depth_per_frame_ms = (depth_ms + 2.0 * (finer.frames - 1) as f64) / finer.frames as f64;
                let has_room =
                    depth_per_frame_ms < 0.8 * 29.7 && blur_ms < 0.8 * 33.0 && 4.0 + depth_ms + blur_ms < 0.8 * 52.8;
                assert!(!has_room, "{times_ms:?}: {plan:?} where there is time for {finer:?}");
            }
        }
    }
}

#[test]
fn without_a_pace_depth_is_as_good_as_it_gets() {
    let mut planner = Planner::new(PERIOD_NS, None, &EFFORT_COSTS, true, LEVEL_COSTS, [BALANCED, BALANCED]);
    let plans = play(&mut planner, (500.0, 60.0), 100);
    assert!(plans.iter().all(|plan| plan.frames == 1 && plan.effort == 1));
    assert_eq!(plans[99].level, 0);
}

#[test]
fn a_gpu_takes_a_finer_blur_while_depth_is_shared() {
    let plan = play(&mut planner(&[1.0], &GPU_COSTS), (45.0, 3.0), 300)[299];
    assert_eq!((plan.frames, plan.level), (2, 2));
}

#[test]
fn frames_that_are_all_too_late_lower_the_plan_as_well() {
    let mut planner = planner(&[1.0], LEVEL_COSTS);
    for frame in 0..60 {
        let depth = DepthTimes { effort: Some(0), took_ns: 70 * MS, age_ns: 4 * MS, at_ns: frame * PERIOD_NS };
        planner.record_depth(depth);
        planner.record_late_frame();
    }
    assert_eq!(planner.plan().frames, 3);
}

#[test]
fn depth_is_shared_only_where_that_saves_something_and_costs_the_blur_nothing_where_not() {
    for depth_ms in [32.0, 45.0, 70.0] {
        for (held, shares) in [(0.1, true), (0.5, true), (0.9, false), (1.2, false)] {
            let mut planner = planner(&[1.0], LEVEL_COSTS);
            let plans = play_with_reuse(&mut planner, (depth_ms, 8.0), held * depth_ms, 600);
            assert_eq!(plans[300].frames > 1, shares, "{depth_ms} ms, held {held}: {:?}", plans[300]);
            assert!(plans[300..].windows(2).all(|pair| pair[0].frames == pair[1].frames), "it stays so");
            assert!(shares || plans[599].level == BALANCED, "{depth_ms} ms: {:?}", plans[599]);
        }
    }
}

/// Simulates depth of `depth_ms`, and `spike_ms` in one frame of eight. Returns the fractions of frames with the usual
/// blur and with shared depth, after settling.
fn play_with_spikes(planner: &mut Planner, (depth_ms, spike_ms, blur_ms): (u64, u64, f64)) -> [f64; 2] {
    let (mut usual, mut shared) = (0, 0);
    for frame in 0..1200 {
        let (plan, at_ns) = (planner.plan(), frame * PERIOD_NS);
        let took_ns = MS * if frame % 8 == 0 { spike_ms } else { depth_ms };
        planner.record_depth(DepthTimes { effort: Some(plan.effort), took_ns, age_ns: 5 * MS, at_ns });
        let blur_ns = (blur_ms * MS as f64 * LEVEL_COSTS[plan.level]) as u64;
        planner.record_blur(Sample { level: plan.level, took_ns: blur_ns, at_ns });
        if frame >= 300 {
            usual += usize::from(plan.level == BALANCED);
            shared += usize::from(plan.frames > 1);
        }
    }
    [usual, shared].map(|frames| frames as f64 / 900.0)
}

/// Other processes delay depth in one of eight frames: no level of the blur compensates for that.
#[test]
fn spikes_of_depth_do_not_lower_a_blur_that_has_time() {
    for (shares, efforts) in [(false, &[1.0][..]), (true, &[1.0]), (true, &EFFORT_COSTS)] {
        for spike_ms in [20, 40, 60, 90] {
            let start = [BALANCED, BALANCED];
            let mut planner = Planner::new(PERIOD_NS, Some(PERIOD_NS), efforts, shares, LEVEL_COSTS, start);
            let [usual, shared] = play_with_spikes(&mut planner, (20, spike_ms, 11.0));
            assert!(usual > 0.9, "{shares} {efforts:?} {spike_ms}: the usual blur for {usual:.2} of the frames");
            assert!(shares || shared == 0.0);
        }
    }
}

/// A mask belongs to its frame: the frame rate drops instead, and the blur is lowered first if that helps.
#[test]
fn depth_that_may_not_be_shared_never_is_and_the_blur_gives_way_first() {
    for (depth_ms, level) in [(20.0, BALANCED), (26.0, BALANCED), (31.0, 0), (60.0, BALANCED), (200.0, BALANCED)] {
        let start = [BALANCED, BALANCED];
        let mut planner = Planner::new(PERIOD_NS, Some(PERIOD_NS), &[1.0], false, LEVEL_COSTS, start);
        let plans = play(&mut planner, (depth_ms, 9.0), 600);
        assert!(plans.iter().all(|plan| plan.frames == 1), "{depth_ms} ms");
        assert_eq!(plans[599].level, level, "{depth_ms} ms");
    }
}

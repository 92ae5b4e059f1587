use super::*;
use crate::budget::load::{IDLE_NS, LEARN_FRAMES, MAX_COST_RATIO, RECENT_LOADS};

const COSTS: [f64; 5] = [1.0, 1.5, 2.0, 3.0, 4.0];
const BUDGET_NS: u64 = 1_000_000;
const PERIOD_NS: u64 = 33_000_000;

/// A simulated machine with this load (nanoseconds at the cheapest level) and a governor; samples are `late` frames
/// late.
struct Machine {
    governor: Governor<1>,
    costs: [f64; 5],
    in_flight: std::collections::VecDeque<(usize, f64)>,
    late: usize,
    now_ns: u64,
    switches: usize,
}

impl Machine {
    fn new(late: usize) -> Self {
        let governor = Governor::new(&COSTS, 2);
        let in_flight = std::collections::VecDeque::new();
        Self { governor, costs: COSTS, in_flight, late, now_ns: PERIOD_NS, switches: 0 }
    }

    /// Simulates frames, ten times as slow where `spike` is true. Returns the level of each.
    fn play(&mut self, load_ns: f64, frames: usize, spike: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut levels = Vec::new();
        for frame in 0..frames {
            let level = self.governor.level();
            levels.push(level);
            let took_ns = load_ns * self.costs[level] * if spike(frame) { 10.0 } else { 1.0 };
            self.in_flight.push_back((level, took_ns));
            self.now_ns += PERIOD_NS;
            if self.in_flight.len() > self.late {
                let (level, took_ns) = self.in_flight.pop_front().unwrap();
                let sample = Sample { level, took_ns: took_ns as u64, at_ns: self.now_ns };
                self.governor.record(sample, BUDGET_NS);
            }
            self.switches += usize::from(self.governor.level() != level);
        }
        levels
    }
}

#[test]
fn the_finest_rung_that_fits_is_found_in_one_step_and_kept() {
    for late in [0, 3] {
        for (load_ns, fits) in [(200_000.0, 4), (250_000.0, 3), (400_000.0, 2), (550_000.0, 1), (900_000.0, 0)] {
            let mut machine = Machine::new(late);
            machine.play(load_ns, 100, |_| false);
            assert_eq!((machine.governor.level(), machine.switches <= 1), (fits, true), "{load_ns} {late}");
            machine.play(load_ns, 1000, |_| false);
            assert_eq!((machine.governor.level(), machine.switches <= 1), (fits, true), "{load_ns} {late}");
        }
    }
}

#[test]
fn down_at_once_up_after_a_while() {
    for late in [0, 3] {
        let mut machine = Machine::new(late);
        machine.play(200_000.0, 200, |_| false);
        assert_eq!(machine.governor.level(), 4);
        let down = machine.play(550_000.0, 60, |_| false);
        assert!(down.iter().position(|&level| level == 1).is_some_and(|frame| frame <= 3 + late), "{down:?}");
        let up = machine.play(200_000.0, 200, |_| false);
        let rose = up.iter().position(|&level| level == 4).unwrap();
        assert!((PATIENCE as usize..PATIENCE as usize + RECENT_LOADS + late + 1).contains(&rose), "{rose}");
        assert!(up[..rose].iter().all(|&level| level == 1), "in one step");
    }
}

#[test]
fn rare_spikes_change_nothing() {
    let mut machine = Machine::new(0);
    machine.play(400_000.0, 100, |_| false);
    let before = machine.switches;
    let levels = machine.play(400_000.0, 3000, |frame| frame % 100 == 50);
    assert!(levels.iter().all(|&level| level == 2));
    assert_eq!(machine.switches, before);
}

#[test]
fn the_floor_is_the_floor() {
    let mut machine = Machine::new(0);
    machine.play(50_000_000.0, 50, |_| false);
    assert_eq!(machine.governor.level(), 0);
    assert_eq!(machine.governor.expected_ns(), Some(50_000_000));
}

#[test]
fn costs_are_learnt_until_a_ladder_that_was_misjudged_does_not_pump() {
    let mut machine = Machine::new(0);
    // The fourth level costs more than declared: it seems to fit, and does not.
    machine.costs = [1.0, 1.5, 2.0, 3.9, 4.5];
    let switches_in = |machine: &mut Machine| {
        let before = machine.switches;
        machine.play(280_000.0, 1800, |_| false);
        machine.switches - before
    };
    let (first, _, third) = (switches_in(&mut machine), switches_in(&mut machine), switches_in(&mut machine));
    assert!((2..=6).contains(&first) && third == 0, "{first} switches in the first minute, {third} in the third");
    let learnt = machine.governor.costs();
    assert!(learnt.is_sorted() && learnt[3] > 3.08, "{learnt:?}");
}

#[test]
fn a_sample_that_measures_nothing_is_none() {
    let mut governor = Governor::new(&COSTS, 3);
    for at_ns in [5, 3, 0, 9] {
        governor.record(Sample { level: 3, took_ns: 0, at_ns }, BUDGET_NS);
        governor.record(Sample { level: 77, took_ns: 9_000_000, at_ns }, BUDGET_NS);
    }
    assert_eq!((governor.level(), governor.expected_ns()), (3, None));
    // Decreasing timestamps are accepted.
    (0..5).for_each(|k| governor.record(Sample { level: 3, took_ns: 9_000_000, at_ns: 50 - k }, BUDGET_NS));
    assert_eq!(governor.level(), 0);
}

#[test]
fn after_a_long_pause_only_what_is_new_counts() {
    let mut machine = Machine::new(0);
    machine.play(550_000.0, 100, |_| false);
    assert_eq!(machine.governor.level(), 1);
    machine.now_ns += 10 * IDLE_NS;
    // A slow first frame (CPU clocks must rise) changes nothing, and the load before the pause is forgotten.
    let levels = machine.play(200_000.0, 60, |frame| frame < 1);
    assert!(levels.iter().all(|&level| level >= 1));
    assert_eq!(machine.governor.level(), 4);
}

#[test]
fn late_samples_of_another_rung_decide_nothing() {
    let mut governor = Governor::new(&COSTS, 4);
    for at_ns in 1..=20 {
        governor.record(Sample { level: 2, took_ns: 50_000_000, at_ns }, BUDGET_NS);
    }
    assert_eq!(governor.level(), 4);
    // Its own first samples do, together with those of the others.
    (21..24).for_each(|at_ns| governor.record(Sample { level: 4, took_ns: 90_000_000, at_ns }, BUDGET_NS));
    assert_eq!(governor.level(), 0);
}

#[test]
fn a_smaller_budget_is_heeded_at_once() {
    let mut machine = Machine::new(0);
    machine.play(240_000.0, 200, |_| false);
    assert_eq!(machine.governor.level(), 3);
    let sample = Sample { level: 3, took_ns: 720_000, at_ns: machine.now_ns };
    machine.governor.record(sample, BUDGET_NS / 2);
    assert_eq!(machine.governor.level(), 1);
}

/// Simulates a load light enough for the finest level. Returns the number of frames until it is reached.
fn frames_until_finest(machine: &mut Machine) -> u32 {
    let rises = |_: &u32| {
        machine.play(200_000.0, 1, |_| false);
        machine.governor.level() == 4
    };
    (1..5000).find(rises).expect("it rises")
}

/// Simulates a load that needs a step down, after enough frames that it is not attributed to a wrong cost.
fn force_step_down(machine: &mut Machine) {
    machine.play(200_000.0, LEARN_FRAMES, |_| false);
    machine.play(400_000.0, 10, |_| false);
    assert_eq!(machine.governor.level(), 2);
}

/// Whether a step up after `frames` frames had this patience: the earlier loads must be forgotten first.
fn is_patience(patience: u32, frames: u32) -> bool {
    (patience..=patience + RECENT_LOADS as u32).contains(&frames)
}

#[test]
fn a_step_that_is_taken_back_is_tried_ever_more_rarely_until_one_holds() {
    let mut machine = Machine::new(0);
    for patience in [30, 60, 120, 240, 480, 960, 960] {
        let frames = frames_until_finest(&mut machine);
        assert!(is_patience(patience, frames), "{frames} frames where {patience} are to be");
        force_step_down(&mut machine);
    }
    frames_until_finest(&mut machine);
    machine.play(200_000.0, (REVERT_FACTOR * MAX_PATIENCE) as usize, |_| false);
    force_step_down(&mut machine);
    let frames = frames_until_finest(&mut machine);
    assert!(is_patience(PATIENCE, frames), "{frames} frames after a step up that held");
}

#[test]
fn a_pause_ends_the_wait_for_the_next_try() {
    let mut machine = Machine::new(0);
    for _ in 0..4 {
        frames_until_finest(&mut machine);
        force_step_down(&mut machine);
    }
    machine.now_ns += 2 * IDLE_NS;
    let frames = frames_until_finest(&mut machine);
    assert!(is_patience(PATIENCE, frames), "{frames} frames after a pause");
}

#[test]
fn a_load_that_is_too_high_now_and_then_is_too_high() {
    let mut machine = Machine::new(0);
    // Every sixth frame takes too long at the fourth level; the median does not show it.
    let mut play = |frames: usize| -> Vec<usize> {
        (0..frames).flat_map(|k| machine.play(if k % 6 == 5 { 420_000.0 } else { 240_000.0 }, 1, |_| false)).collect()
    };
    play(300);
    assert!(play(600).iter().all(|&level| level == 2));
}

#[test]
fn a_step_up_goes_no_further_than_was_allowed_all_the_while() {
    let mut machine = Machine::new(0);
    machine.play(550_000.0, 100, |_| false);
    assert_eq!(machine.governor.level(), 1);
    // At first the fourth level fits, then the fifth.
    machine.play(280_000.0, 25, |_| false);
    let up = machine.play(200_000.0, 40, |_| false);
    let rose: Vec<usize> = up.chunk_by(|a, b| a == b).map(|levels| levels[0]).collect();
    assert_eq!(rose, [1, 3], "{up:?}");
    machine.play(200_000.0, 40, |_| false);
    assert_eq!(machine.governor.level(), 4);
}

#[test]
fn no_cost_is_learnt_beyond_what_is_credible() {
    let mut machine = Machine::new(0);
    // The finest level takes ten times its declared cost.
    machine.costs = [1.0, 1.5, 2.0, 3.0, 40.0];
    machine.play(70_000.0, 5000, |_| false);
    assert_eq!(machine.governor.costs()[4], MAX_COST_RATIO * COSTS[4]);
}

/// Returns the expected time after ten equal frames, a pause, and one faster frame.
fn expected_after(pause_ns: u64) -> Option<u64> {
    let mut governor = Governor::new(&[1.0], 0);
    (1..=10).for_each(|at_ns| governor.record(Sample { level: 0, took_ns: 500, at_ns }, BUDGET_NS));
    governor.record(Sample { level: 0, took_ns: 50, at_ns: 10 + pause_ns }, BUDGET_NS);
    governor.expected_ns()
}

#[test]
fn only_a_pause_that_is_long_enough_is_one() {
    assert_eq!([IDLE_NS, IDLE_NS + 1].map(expected_after), [Some(500), Some(50)]);
}

#[test]
fn the_first_step_up_comes_with_the_last_frame_of_the_patience() {
    let mut governor = Governor::new(&COSTS, 0);
    let mut levels = (1..=PATIENCE).map(|frame| {
        governor.record(Sample { level: 0, took_ns: 200_000, at_ns: u64::from(frame) }, BUDGET_NS);
        governor.level()
    });
    assert_eq!((levels.by_ref().take(PATIENCE as usize - 1).max(), levels.next()), (Some(0), Some(4)));
}

#[test]
fn a_load_that_is_about_the_budget_changes_nothing() {
    // `KEEP_FRACTION`, relative to the median, is between these.
    for (fraction_of_budget, kept) in [(0.92, true), (0.95, false)] {
        let mut machine = Machine::new(0);
        machine.play(fraction_of_budget * BUDGET_NS as f64 / COSTS[2], 300, |_| false);
        assert_eq!(machine.governor.level() == 2, kept, "{fraction_of_budget}");
    }
}

#[test]
fn a_step_up_has_held_after_twice_the_patience_and_not_before() {
    for (frames, patience) in [(REVERT_FACTOR * PATIENCE - 15, 2 * PATIENCE), (REVERT_FACTOR * PATIENCE, PATIENCE)] {
        let mut machine = Machine::new(0);
        frames_until_finest(&mut machine);
        machine.play(200_000.0, frames as usize, |_| false);
        force_step_down(&mut machine);
        let needed = frames_until_finest(&mut machine);
        assert!(is_patience(patience, needed), "{needed} frames after a step up that lasted {frames}");
    }
}

use std::time::Duration;

use super::model::{Chances, EBUSY, ENODEV, ENOSPC, Facts, Model, PERIOD_NS, PLANE_BYTES};
use super::{Losses, Queue, QueueError};
use bokehcam::clock::Clock;

const TIMEOUT: Duration = Duration::from_millis(100);

fn open(model: &Model, clock: &Clock) -> Result<Queue<Model>, QueueError> {
    Queue::new(model.clone(), &[PLANE_BYTES, PLANE_BYTES], PERIOD_NS, clock.clone())
}

fn errno(error: &QueueError) -> i32 {
    error.source().and_then(std::io::Error::raw_os_error).unwrap_or(0)
}

fn add_losses(sum: &mut Losses, losses: Losses) {
    sum.missed += losses.missed;
    sum.stale += losses.stale;
    sum.corrupt += losses.corrupt;
}

#[test]
fn the_newest_frame_wins_and_the_others_are_counted() {
    let clock = Clock::manual();
    let model = Model::new(1, Chances::default(), clock.clone());
    let mut queue = open(&model, &clock).unwrap();
    queue.start().unwrap();
    let (mut taken, mut losses) = (0, Losses::default());
    let mut last = None;
    for _ in 0..1000 {
        assert!(queue.wait_newest(TIMEOUT).unwrap());
        let (frame, planes) = queue.current().unwrap();
        assert_eq!((planes.len(), planes[0].len(), planes[1].len()), (2, PLANE_BYTES, PLANE_BYTES));
        assert!(last < Some(frame.sequence), "frames come in order");
        last = Some(frame.sequence);
        taken += 1;
        queue.release();
        add_losses(&mut losses, queue.take_losses());
    }
    let Facts { delivered, missed, max_queued, .. } = model.0.borrow().facts.clone();
    assert_eq!((losses.missed, losses.corrupt, max_queued), (missed, 0, 4));
    assert!(losses.stale > 100, "the model shoots up to three frames between two looks");
    assert_eq!(delivered, taken + losses.stale);
}

#[test]
fn every_loss_counts_once() {
    assert_eq!(Losses { missed: 1, stale: 20, corrupt: 300 }.total(), 321);
}

#[test]
fn parts_of_damaged_frames_are_never_given_out() {
    let clock = Clock::manual();
    let chances = Chances { damaged: 0.5, ..Chances::default() };
    let model = Model::new(3, chances, clock.clone());
    let mut queue = open(&model, &clock).unwrap();
    queue.start().unwrap();
    let mut losses = Losses::default();
    for _ in 0..500 {
        if queue.wait_newest(TIMEOUT).unwrap() {
            let (frame, planes) = queue.current().unwrap();
            assert!(!frame.flagged && planes[1].len() == PLANE_BYTES);
            queue.release();
        }
        add_losses(&mut losses, queue.take_losses());
    }
    assert_eq!(losses.corrupt, model.0.borrow().facts.damaged);
    assert!(losses.corrupt > 100);
}

#[test]
fn too_few_buffers_are_refused_and_freed() {
    let clock = Clock::manual();
    for (granted, enough) in [(0, false), (1, false), (2, true), (3, true)] {
        let model = Model::new(1, Chances::default(), clock.clone());
        model.0.borrow_mut().granted = granted;
        match open(&model, &clock) {
            Ok(mut queue) => {
                assert!(enough);
                queue.start().unwrap();
                assert!(queue.wait_newest(TIMEOUT).unwrap());
            }
            Err(QueueError::TooFewBuffers { granted: told }) => assert!(!enough && told == granted),
            Err(other) => panic!("{other}"),
        }
        assert!(model.is_clean());
    }
}

#[test]
fn a_frame_that_was_not_released_goes_back_and_counts() {
    let clock = Clock::manual();
    let model = Model::new(5, Chances::default(), clock.clone());
    let mut queue = open(&model, &clock).unwrap();
    queue.start().unwrap();
    for _ in 0..20 {
        assert!(queue.wait_newest(TIMEOUT).unwrap());
    }
    queue.stop();
    assert!(queue.current().is_none());
    let losses = queue.take_losses();
    assert_eq!(losses.stale, model.0.borrow().facts.delivered);
    queue.start().unwrap();
    assert!(queue.wait_newest(TIMEOUT).unwrap());
    drop(queue);
    assert!(model.is_clean());
}

#[test]
fn what_came_before_the_beginning_is_not_counted() {
    let clock = Clock::manual();
    let model = Model::new(7, Chances::default(), clock.clone());
    let mut queue = open(&model, &clock).unwrap();
    queue.start().unwrap();
    // All buffers are filled, and further frames are dropped.
    for _ in 0..9 {
        model.0.borrow_mut().capture_frame();
    }
    queue.reset_losses();
    let before = model.0.borrow().facts.delivered;
    assert_eq!(before, 4, "one for each buffer");
    assert!(queue.wait_newest(TIMEOUT).unwrap());
    let (sequence, losses) = (queue.current().unwrap().0.sequence, queue.take_losses());
    let after = model.0.borrow().facts.delivered - before;
    assert!(sequence >= 9, "{sequence}");
    assert_eq!(losses, Losses { stale: after - 1, ..Losses::default() });
}

#[test]
fn a_buffer_that_was_refused_is_offered_again() {
    let clock = Clock::manual();
    let model = Model::new(9, Chances::default(), clock.clone());
    let mut queue = open(&model, &clock).unwrap();
    queue.start().unwrap();
    for round in 0..3 {
        assert!(queue.wait_newest(TIMEOUT).unwrap());
        // Skipped buffers are requeued; the one that was read is refused.
        model.0.borrow_mut().chances.refused = 1.0;
        queue.release();
        model.0.borrow_mut().chances.refused = 0.0;
        assert_eq!(model.0.borrow().queued_buffers(), 3, "round {round}");
        assert!(queue.wait_newest(TIMEOUT).unwrap());
        assert_eq!(model.0.borrow().queued_buffers(), 3, "all but the one that is being read");
        queue.release();
        assert_eq!(model.0.borrow().queued_buffers(), 4);
    }
}

#[test]
fn a_buffer_of_which_nothing_can_be_learnt_is_left_to_the_kernel() {
    let clock = Clock::manual();
    let model = Model::new(11, Chances::default(), clock.clone());
    let mut queue = open(&model, &clock).unwrap();
    queue.start().unwrap();
    let fails = |fails: bool| {
        let mut state = model.0.borrow_mut();
        (state.queries_fail, state.chances.refused) = (fails, if fails { 1.0 } else { 0.0 });
    };
    fails(true);
    assert!(queue.wait_newest(TIMEOUT).is_err());
    fails(false);
    // The model panics if a buffer that it owns is queued again.
    assert!(queue.wait_newest(TIMEOUT).unwrap());
}

/// Runs a queue against a kernel that fails at random: opens, starts, reads, stops. The model panics where a rule is
/// broken. Returns the frames read, the losses, and the model's counts; adds to `errors` by errno.
fn fuzz(seed: u64, chances: Chances, errors: &mut [u64; 256]) -> (u64, Losses, Facts) {
    let clock = Clock::manual();
    let model = Model::new(seed, chances, clock.clone());
    model.0.borrow_mut().granted = 2 + (seed % 4) as u32;
    let (mut taken, mut losses) = (0, Losses::default());
    let mut count = |error: &QueueError| errors[errno(error) as usize] += 1;
    for _ in 0..12 {
        let mut queue = match open(&model, &clock) {
            Ok(queue) => queue,
            Err(error) => {
                count(&error);
                continue;
            }
        };
        for _ in 0..6 {
            if let Err(error) = queue.start() {
                count(&error);
                continue;
            }
            for _ in 0..40 {
                match queue.wait_newest(TIMEOUT) {
                    Ok(true) => {
                        // Sometimes the reader itself skips a frame.
                        if model.0.borrow_mut().random_bool(0.9) {
                            assert!(queue.current().is_some());
                            taken += 1;
                            queue.release();
                        }
                    }
                    Ok(false) => {}
                    Err(error) => count(&error),
                }
            }
            queue.stop();
        }
        add_losses(&mut losses, queue.take_losses());
        drop(queue);
        assert!(model.is_clean(), "seed {seed}: something is left mapped, queued or streaming");
    }
    let facts = model.0.borrow().facts.clone();
    (taken, losses, facts)
}

#[test]
fn whatever_fails_no_buffer_is_lost_or_queued_twice_and_each_frame_counts_once() {
    let mut errors = [0; 256];
    let mut frames = 0;
    for seed in 1..400 {
        let steps = |step: u64| (seed / step % 4) as f64 / 3.0;
        let chances = Chances {
            interrupted: 0.3 * steps(1),
            refused: 0.2 * steps(4),
            dropped: 0.3 * steps(16),
            damaged: 0.3 * steps(64),
            gone: 0.0,
        };
        let (taken, losses, facts) = fuzz(seed, chances, &mut errors);
        assert_eq!(taken + losses.stale + losses.corrupt, facts.delivered, "seed {seed}: {losses:?} {facts:?}");
        assert_eq!(losses.corrupt, facts.damaged, "seed {seed}");
        assert_eq!(losses.missed, facts.missed, "seed {seed}");
        frames += facts.delivered;
    }
    assert!(frames > 100_000, "{frames}");
    assert!(errors[EBUSY as usize] > 10 && errors[ENOSPC as usize] > 10 && errors[super::EIO as usize] > 1000);
}

#[test]
fn a_device_that_goes_leaves_nothing_mapped() {
    let mut errors = [0; 256];
    let mut gone = 0;
    for seed in 1..200 {
        let chances = Chances { interrupted: 0.1, refused: 0.05, gone: 0.02, ..Chances::default() };
        let (taken, losses, facts) = fuzz(seed, chances, &mut errors);
        assert_eq!(taken + losses.stale + losses.corrupt, facts.delivered, "seed {seed}");
        gone += u64::from(errors[ENODEV as usize] > 0);
    }
    assert!(gone > 100);
}

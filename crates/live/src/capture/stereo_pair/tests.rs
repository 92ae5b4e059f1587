use super::*;
use bokehcam::frame::{DepthMap, GrayImage, Stamp};

const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 33 * MS;

/// A camera whose frames arrive at these times; every byte of a frame is its index. As with a driver, a frame that is
/// not read before the next one arrives is lost.
struct FakeCamera {
    clock: Clock,
    captured_ns: Vec<u64>,
    next: usize,
    size: (u32, u32),
}

impl PairedCamera for FakeCamera {
    fn info(&self) -> SourceInfo {
        let (name, frame_data) = ("fake".to_owned(), FrameData::Color);
        SourceInfo { name, size: self.size, period_ns: PERIOD_NS, frames: None, live: true, frame_data }
    }

    fn next_within(&mut self, timeout: Duration, color: &mut ColorImage) -> Captured {
        let now_ns = self.clock.now_ns();
        let overwritten = self.captured_ns[self.next..].windows(2).take_while(|pair| pair[1] <= now_ns).count();
        if overwritten > 0 {
            self.next += overwritten;
            return Captured::Lost(overwritten as u64, DropCause::Evicted);
        }
        let until_ns = now_ns + timeout.as_nanos() as u64;
        match self.captured_ns.get(self.next) {
            Some(&captured_ns) if captured_ns <= until_ns => {
                self.clock.sleep_until_ns(captured_ns);
                color.resize(self.size.0, self.size.1);
                color.rgb.fill(self.next as u8);
                self.next += 1;
                Captured::Frame(Stamp { index: self.next - 1, time_ns: captured_ns, captured_ns: Some(captured_ns) })
            }
            Some(_) => {
                self.clock.sleep_until_ns(until_ns);
                Captured::Waiting
            }
            None => Captured::End,
        }
    }

    fn suspend(&mut self) {}
}

fn create_pair(left_ns: Vec<u64>, right_ns: Vec<u64>) -> (StereoPair<FakeCamera>, Clock) {
    let clock = Clock::manual();
    let camera = |captured_ns| FakeCamera { clock: clock.clone(), captured_ns, next: 0, size: (4, 2) };
    (StereoPair::new(camera(left_ns), camera(right_ns), clock.clone(), None).unwrap(), clock)
}

fn times(frames: impl Iterator<Item = u64>, skew_ns: u64) -> Vec<u64> {
    frames.map(|k| (k + 1) * PERIOD_NS + skew_ns).collect()
}

/// Returns the indices of the pairs, and the numbers of frames lost without a partner and otherwise; the reader takes
/// `takes_ns` per pair.
fn play(camera: &mut StereoPair<FakeCamera>, clock: &Clock, takes_ns: u64) -> (Vec<(u8, u8)>, u64, u64) {
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    let (mut pairs, mut unpaired, mut lost) = (Vec::new(), 0, 0);
    loop {
        match camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right }).unwrap() {
            Captured::Frame(stamp) => {
                assert_eq!((color.size(), right.size(), stamp.index as u8), ((4, 2), (4, 2), color.rgb[0]));
                pairs.push((color.rgb[0], right.luma[0]));
                clock.advance_ns(takes_ns);
            }
            Captured::Lost(count, DropCause::Unpaired) => unpaired += count,
            Captured::Lost(count, _) => lost += count,
            Captured::Waiting => {}
            Captured::Corrupt(error) => panic!("{error}"),
            Captured::End => return (pairs, unpaired, lost),
        }
    }
}

#[test]
fn frames_of_one_time_come_together_whichever_camera_leads() {
    for (left_skew, right_skew) in [(0, 0), (0, 15 * MS), (15 * MS, 0)] {
        let (mut camera, clock) = create_pair(times(0..50, left_skew), times(0..50, right_skew));
        assert_eq!(camera.info().frame_data, FrameData::RightCamera);
        let (pairs, unpaired, lost) = play(&mut camera, &clock, 3 * MS);
        assert!(pairs.into_iter().eq((0..50).map(|k| (k, k))), "{left_skew} {right_skew}");
        assert_eq!((unpaired, lost), (0, 0));
        assert!(camera.skews.max_ns() == left_skew.abs_diff(right_skew));
    }
}

#[test]
fn a_frame_without_a_partner_is_counted_and_the_next_ones_are_pairs_again() {
    // The right camera loses frames 5 and 6, the left one frame 20.
    let left = times((0..40).filter(|&k| k != 20), 2 * MS);
    let right = times((0..40).filter(|&k| k != 5 && k != 6), 9 * MS);
    let (mut camera, clock) = create_pair(left, right);
    let (pairs, unpaired, lost) = play(&mut camera, &clock, MS);
    assert_eq!((pairs.len(), unpaired, lost), (37, 2, 0));
    // Indices count the frames that each camera delivered.
    assert_eq!((pairs[4], pairs[5], pairs[36]), ((4, 4), (7, 5), (38, 37)));
}

#[test]
fn one_camera_gone_costs_the_frames_of_that_time_and_half_a_period_each() {
    let (mut camera, clock) = create_pair(times(0..40, 0), times((0..10).chain(30..40), 5 * MS));
    let (pairs, unpaired, lost) = play(&mut camera, &clock, MS);
    assert_eq!((pairs.len() as u64, unpaired, lost), (20, 20, 0));
    assert_eq!(pairs[10], (30, 10));
    let (mut camera, clock) = create_pair(times((0..10).chain(30..40), 0), times(0..40, 5 * MS));
    let (pairs, unpaired, lost) = play(&mut camera, &clock, MS);
    assert_eq!((pairs.len(), unpaired, lost), (20, 0, 0));
    assert_eq!(pairs[19], (19, 39));
}

#[test]
fn who_reads_slowly_gets_fewer_pairs_and_every_left_frame_is_accounted_for() {
    let (mut camera, clock) = create_pair(times(0..90, 0), times(0..90, 7 * MS));
    let (pairs, unpaired, lost) = play(&mut camera, &clock, 50 * MS);
    assert_eq!(pairs.len() as u64 + unpaired + lost, 90);
    assert!(pairs.len() >= 30 && pairs.iter().all(|(left, right)| left == right), "{pairs:?}");
}

#[test]
fn eyes_of_two_sizes_are_refused() {
    let clock = Clock::manual();
    let camera = |size| FakeCamera { clock: clock.clone(), captured_ns: Vec::new(), next: 0, size };
    let error =
        StereoPair::new(camera((640, 480)), camera((1280, 720)), clock.clone(), None).err().unwrap().to_string();
    assert!(error.contains("640x480") && error.contains("1280x720") && error.contains("--size"), "{error}");
}

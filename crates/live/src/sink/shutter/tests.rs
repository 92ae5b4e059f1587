use std::sync::Mutex;
use std::thread;

use super::*;

const PERIOD: Duration = Duration::from_millis(40);
const PERIOD_NS: u64 = PERIOD.as_nanos() as u64;

/// The pictures that a sink got: whether each is the card, and its time.
type Got = Arc<Mutex<Vec<(bool, u64)>>>;

struct Witness(Got);

impl Sink for Witness {
    fn write_frame(&mut self, _: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.0.lock().unwrap().push((false, time_ns));
        Ok(ControlFlow::Continue(()))
    }

    fn wants_yuyv(&mut self) -> bool {
        true
    }

    fn write_yuyv(&mut self, _: &mut YuyvImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.0.lock().unwrap().push((false, time_ns));
        Ok(ControlFlow::Continue(()))
    }

    fn write_card(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        assert!(card.rgb.iter().any(|&value| value > 0), "the card is drawn");
        self.0.lock().unwrap().push((true, time_ns));
        Ok(ControlFlow::Continue(()))
    }
}

fn shutter() -> (Shutter, ShutterControl, Demand, Clock, Got) {
    let (demand, clock, got) = (Demand::new(), Clock::manual(), Got::default());
    let sink = Box::new(Witness(Arc::clone(&got)));
    let (shutter, control) = Shutter::new(sink, (32, 18), PERIOD, demand.clone(), clock.clone(), Arc::default());
    (shutter, control, demand, clock, got)
}

#[test]
fn a_closed_shutter_lets_nothing_pass_and_the_camera_rests() {
    let (mut shutter, control, demand, clock, got) = shutter();
    let _watch = demand.watch();
    let picture = ColorImage::new(32, 18);
    assert!(shutter.write_frame(&picture, 0).unwrap().is_continue());
    assert_eq!(shutter.repeat_interval(), Some(TICK));
    clock.advance_ns(PERIOD_NS);
    assert_eq!(shutter.repeat_frame().unwrap(), ControlFlow::Continue(false), "open, it is as its sink");
    control.close(true);
    assert!(demand.is_watched(), "a camera that rested before the card is there would leave the last picture");
    assert_eq!(shutter.repeat_frame().unwrap(), ControlFlow::Continue(true), "nobody waits for a frame");
    assert!(!demand.is_watched() && demand.has_watchers());
    assert_eq!(shutter.repeat_frame().unwrap(), ControlFlow::Continue(false), "not more often than frames");
    // A picture that was in flight.
    assert!(shutter.write_frame(&picture, PERIOD_NS).unwrap().is_continue());
    for _ in 0..2 {
        clock.advance_ns(PERIOD_NS);
        assert_eq!(shutter.repeat_interval(), Some(Duration::ZERO));
        assert_eq!(shutter.repeat_frame().unwrap(), ControlFlow::Continue(true));
    }
    control.close(false);
    clock.advance_ns(PERIOD_NS);
    assert_eq!(shutter.repeat_frame().unwrap(), ControlFlow::Continue(true), "the card stays until there is a picture");
    assert!(demand.is_watched());
    // The source stood still meanwhile; the sink's time advances all the same.
    for time in [2, 3] {
        assert!(shutter.write_frame(&picture, time * PERIOD_NS).unwrap().is_continue());
    }
    let got = got.lock().unwrap().clone();
    let cards: Vec<bool> = got.iter().map(|got| got.0).collect();
    assert_eq!(cards, [false, true, true, true, true, true, false, false]);
    assert!(got.windows(2).all(|pair| pair[0].1 < pair[1].1), "{got:?}");
    assert_eq!(got[7].1 - got[6].1, PERIOD_NS);
}

#[test]
fn time_goes_on_as_the_source_says_where_that_did_not_rest() {
    let (mut shutter, control, _, clock, got) = shutter();
    let picture = ColorImage::new(32, 18);
    for (frame, closed) in [false, true, true, false, false].into_iter().enumerate() {
        control.close(closed);
        let _ = shutter.write_frame(&picture, frame as u64 * PERIOD_NS).unwrap();
        clock.advance_ns(PERIOD_NS);
    }
    let times: Vec<u64> = got.lock().unwrap().iter().map(|got| got.1 / PERIOD_NS).collect();
    assert_eq!(times, [0, 1, 2, 3, 4]);
}

#[test]
fn a_copy_is_of_a_picture_that_passed() {
    let (mut shutter, control, _, _, _) = shutter();
    let asking = control.clone();
    let asks = std::thread::spawn(move || asking.copy_next_picture(Duration::from_secs(60)));
    let mut picture = ColorImage::new(32, 18);
    picture.rgb.fill(77);
    let mut time_ns = 0;
    while !asks.is_finished() {
        time_ns += PERIOD_NS;
        let _ = shutter.write_frame(&picture, time_ns).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(asks.join().unwrap().unwrap().rgb, picture.rgb);
    control.close(true);
    assert!(control.copy_next_picture(Duration::from_millis(20)).is_none());
    let _ = shutter.write_frame(&picture, time_ns + 1).unwrap();
    drop(shutter);
    assert!(control.copy_next_picture(Duration::from_secs(60)).is_none(), "nobody is waited for who is gone");
}

#[test]
fn a_copy_is_in_full_colour_and_what_is_yuyv_stays_behind_a_closed_shutter_as_well() {
    let (mut shutter, control, _, _, got) = shutter();
    let (picture, mut yuyv) = (ColorImage::new(32, 18), YuyvImage::default());
    assert!(shutter.wants_yuyv(), "as its sink does");
    let asks = std::thread::spawn({
        let control = control.clone();
        move || control.copy_next_picture(Duration::from_secs(60))
    });
    while shutter.wants_yuyv() {
        std::thread::sleep(Duration::from_millis(1));
    }
    // A picture in flight passes, and is not the requested copy.
    assert!(shutter.write_yuyv(&mut yuyv, 0).unwrap().is_continue());
    assert!(!shutter.wants_yuyv() && !asks.is_finished());
    assert!(shutter.write_frame(&picture, PERIOD_NS).unwrap().is_continue());
    assert_eq!(asks.join().unwrap().unwrap(), picture);
    assert!(shutter.wants_yuyv());
    control.close(true);
    assert!(shutter.write_yuyv(&mut yuyv, 2 * PERIOD_NS).unwrap().is_continue());
    let cards: Vec<bool> = got.lock().unwrap().iter().map(|got| got.0).collect();
    assert_eq!(cards, [false, false, true]);
}

#[test]
fn of_clients_that_toggle_at_once_each_is_told_what_it_did() {
    let (_shutter, control, ..) = shutter();
    let closed: i32 = thread::scope(|scope| {
        let toggle = || (0..10_001).map(|_| if control.toggle() { 1 } else { -1 }).sum::<i32>();
        let clients = [(); 3].map(|()| scope.spawn(toggle));
        clients.into_iter().map(|client| client.join().unwrap()).sum()
    });
    assert_eq!(closed, 1, "closed once more than opened");
    assert!(control.is_closed());
}

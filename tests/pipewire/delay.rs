//! How long a picture takes from our hand-over to another program's callback.

use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;

use bokehcam::clock::Clock;
use bokehcam::frame::ColorImage;
use bokehcam::pipewire::mode::{Mode, Offer};
use bokehcam::pipewire::reader::{Agreed, Frame, Reader, Take};
use bokehcam::sink::{Options, PipeWire, Sink};

use super::session::{folder, in_a_calm_moment, until};

const SIZE: (u32, u32) = (1280, 720);
const PERIOD: Duration = Duration::from_micros(33_333);
const PICTURES: usize = 300;

/// Tells how long each picture took.
struct Stopwatch(mpsc::Sender<u64>);

impl Take for Stopwatch {
    fn choose(&mut self, modes: &[Mode]) -> Result<Agreed, String> {
        let Mode { fourcc, sizes: Offer::These(sizes), rates: Offer::These(rates) } = &modes[0] else {
            return Err("it leaves a choice".into());
        };
        Ok(Agreed { fourcc: *fourcc, size: sizes[0], rate: rates[0] })
    }

    fn begin(&mut self, _: &Agreed) {}

    fn frame(&mut self, frame: &Frame) {
        // Who measures may have seen enough.
        let _ = self.0.send(Clock::system().now_ns() - frame.captured_ns);
    }

    fn lost(&mut self, _: u64, _: u64, _: u64) {}
}

/// The other program: this one would not read its own camera.
#[test]
#[ignore = "needs PipeWire (tests/pipewire/session), and who starts it"]
fn the_other_program() {
    let Ok(camera) = std::env::var("CAMERA_TO_TIME") else { return };
    let (to, from) = mpsc::channel();
    let (_reader, ..) = Reader::new(&camera, Stopwatch(to)).unwrap();
    let mut delays_ns: Vec<u64> = from.iter().take(PICTURES).collect();
    delays_ns.sort_unstable();
    let ms = |share: f64| delays_ns[(share * (PICTURES - 1) as f64) as usize] as f64 / 1e6;
    println!("delay ms: p50 {:.2}, p99 {:.2}, max {:.2}", ms(0.5), ms(0.99), ms(1.0));
}

#[test]
#[ignore = "needs PipeWire (tests/pipewire/session)"]
fn a_picture_is_with_the_reader_before_the_next_one_comes() {
    folder();
    let mut sink = PipeWire::open(Some("Timed"), &Options::new(SIZE, PERIOD.as_nanos() as u64)).unwrap();
    let picture = ColorImage::new(SIZE.0, SIZE.1);
    let clock = Clock::system();
    in_a_calm_moment(|| {
        let mut reader = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "delay::the_other_program", "--nocapture"])
            .env("CAMERA_TO_TIME", "timed")
            .stdout(std::fs::File::create(folder().join("delay")).unwrap())
            .spawn()
            .unwrap();
        let ended = until("the reader's end", || {
            // Fifty at a time, so that the end is seen soon.
            for _ in 0..50 {
                sink.captured(clock.now_ns());
                let _ = sink.put(&picture, 0).unwrap();
                std::thread::sleep(PERIOD);
            }
            reader.try_wait().unwrap()
        });
        let said = std::fs::read_to_string(folder().join("delay")).unwrap();
        assert!(ended.success(), "{said}");
        let delays = said.lines().find(|line| line.starts_with("delay ms")).unwrap().to_owned();
        println!("{delays}");
        let p99 = delays.split_once("p99 ").unwrap().1.split(',').next().unwrap();
        if p99.parse::<f64>().unwrap() < PERIOD.as_secs_f64() * 1e3 { Ok(()) } else { Err(delays) }
    });
}

//! Latency from the output of a picture to another program's callback.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use bokehcam::clock::Clock;
use bokehcam::frame::ColorImage;
use bokehcam_live::pipewire::mode::{Mode, NegotiatedFormat, Offer};
use bokehcam_live::pipewire::reader::{Frame, PictureHandler, Reader};
use bokehcam_live::sink::pipewire::PipeWire;
use bokehcam_live::sink::{Options, Sink};

use super::program::Beside;
use super::session::{folder, until};

const SIZE: (u32, u32) = (1280, 720);
const PERIOD: Duration = Duration::from_micros(33_333);
const PICTURES: usize = 300;

/// Sends each picture's time stamp and latency, in nanoseconds.
struct Stopwatch(mpsc::Sender<(u64, u64)>);

impl PictureHandler for Stopwatch {
    fn choose_mode(&mut self, modes: &[Mode]) -> Result<NegotiatedFormat, String> {
        let Mode { fourcc, sizes: Offer::These(sizes), rates: Offer::These(rates) } = &modes[0] else {
            return Err("it leaves a choice".into());
        };
        Ok(NegotiatedFormat { fourcc: *fourcc, size: sizes[0], rate: rates[0] })
    }

    fn set_format(&mut self, _: &NegotiatedFormat) {}

    fn handle_frame(&mut self, frame: &Frame) {
        // The receiver may have ended.
        let _ = self.0.send((frame.captured_ns, Clock::system().now_ns() - frame.captured_ns));
    }

    fn add_losses(&mut self, _: u64, _: u64, _: u64) {}
}

/// The reader process: a program does not read its own camera.
#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session), and who starts it"]
fn the_other_program() {
    let Ok(camera) = std::env::var("CAMERA_TO_TIME") else { return };
    let (to, from) = mpsc::channel();
    let (_reader, ..) = Reader::new(&camera, false, Stopwatch(to)).unwrap();
    // The parent test kills this process when it has enough samples.
    from.iter().for_each(|(captured_ns, delay_ns)| println!("\n{captured_ns} {delay_ns}"));
}

/// The reader process, ended when dropped.
struct Other {
    _program: Beside,
    told: mpsc::Receiver<(u64, u64)>,
    /// Samples received so far.
    heard: VecDeque<(u64, u64)>,
}

impl Other {
    fn start(camera: &str) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--ignored", "--exact", "delay::the_other_program", "--nocapture"]);
        let mut program = Beside::start(command.env("CAMERA_TO_TIME", camera).stdout(Stdio::piped()));
        let (to, told) = mpsc::channel();
        let lines = BufReader::new(program.0.stdout.take().unwrap()).lines().map_while(Result::ok);
        std::thread::spawn(move || {
            let numbers = lines.filter_map(|line| {
                let (captured, delay) = line.split_once(' ')?;
                Some((captured.parse().ok()?, delay.parse().ok()?))
            });
            numbers.for_each(|told| to.send(told).unwrap_or_default());
        });
        Self { _program: program, told, heard: VecDeque::new() }
    }

    /// Returns the latency of the picture with this time stamp, if received.
    fn got(&mut self, captured_ns: u64) -> Option<u64> {
        self.heard.extend(self.told.try_iter());
        self.heard.iter().find(|told| told.0 == captured_ns).map(|told| told.1)
    }

    /// Returns the same once it is known: time stamps increase, so a picture that comes after a later one was lost.
    fn outcome(&mut self, captured_ns: u64) -> Option<Option<u64>> {
        let delay_ns = self.got(captured_ns);
        let is_past = self.heard.iter().any(|told| told.0 > captured_ns);
        (delay_ns.is_some() || is_past).then_some(delay_ns)
    }
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_picture_comes_to_the_reader_without_the_next_one() {
    folder();
    let mut sink = PipeWire::open(Some("Timed"), &Options::new(SIZE, PERIOD.as_nanos() as u64)).unwrap();
    let picture = ColorImage::new(SIZE.0, SIZE.1);
    let clock = Clock::system();
    let mut reader = Other::start("timed");
    let put = |sink: &mut PipeWire| {
        let now_ns = clock.now_ns();
        sink.set_capture_time(now_ns);
        let _ = sink.write_frame(&picture, 0).unwrap();
        now_ns
    };
    // Wait for the reader, which may be more than a period behind.
    let mut puts_ns = Vec::new();
    until("a reader", || {
        puts_ns.push(put(&mut sink));
        std::thread::sleep(PERIOD);
        puts_ns.iter().find_map(|put_ns| reader.got(*put_ns))
    });
    let (mut delays_ns, mut by_itself) = (Vec::new(), 0);
    while delays_ns.len() < PICTURES {
        let (delay_ns, is_by_itself) = until("a picture that is not lost", || {
            let count = sink.node_counters().remove(0);
            let losses = || {
                let now = count();
                now.overtaken + now.no_buffer + now.unwatched
            };
            let (lost_before, repeated_before) = (losses(), count().repeats);
            let put_ns = put(&mut sink);
            // The next picture follows only after this one; only a repeat may come between, if it is late. A reader
            // that is later still reads the repeat only, or begins again.
            let delay_ns = until("the picture, or a later one", || {
                let is_lost = losses() > lost_before;
                reader.outcome(put_ns).or(is_lost.then_some(None))
            })?;
            Some((delay_ns, count().repeats == repeated_before))
        });
        delays_ns.push(delay_ns);
        by_itself += usize::from(is_by_itself);
    }
    let times: Vec<u64> = reader.heard.iter().map(|told| told.0).collect();
    assert!(times.is_sorted_by(|a, b| a < b), "in order, and none twice");
    assert!(by_itself > 0, "each waits until it is shown again");
    // The latency depends on the machine, so it is only printed.
    delays_ns.sort_unstable();
    let ms = |share: f64| delays_ns[(share * (PICTURES - 1) as f64) as usize] as f64 / 1e6;
    println!("delay ms: p50 {:.2}, p99 {:.2}, max {:.2}; {by_itself} by themselves", ms(0.5), ms(0.99), ms(1.0));
}

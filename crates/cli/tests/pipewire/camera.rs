//! The PipeWire output as a camera for other programs.

use std::collections::HashMap;
use std::process::Command;
use std::time::{Duration, Instant};

use bokehcam::frame::YuyvImage;
use bokehcam_live::sink::pipewire::PipeWire;
use bokehcam_live::sink::{Options, Sink};
use rustix::fs::inotify;
use serde_json::Value;

use super::program::{Ran, bokehcam};
use super::readers::GStreamer;
use super::session::{FPS, PICTURES, Player, SIZE, folder, kill, node, picture, state, until, yuyv};

/// Identifies the received pictures by their number; skips the still card before the first one.
fn numbers(frames: &[Vec<u8>]) -> Vec<usize> {
    let known: HashMap<Vec<u8>, usize> = (0..PICTURES).map(|number| (yuyv(&picture(number)), number)).collect();
    let is_card = |frame: &&Vec<u8>| !known.contains_key(*frame);
    let cards = frames.iter().take_while(is_card).count();
    assert!(cards < frames.len(), "{cards} cards, and no picture");
    assert!(frames[..cards].iter().all(|frame| *frame == frames[0] && frame.len() == frames[cards].len()));
    let number = |frame: &Vec<u8>| *known.get(frame).expect("no picture of ours, byte by byte");
    frames[cards..].iter().map(number).collect()
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn the_node_is_what_browsers_and_obs_list() {
    folder();
    let player = Player::start("desk-left", &["--to", "pipewire:Desk, left"]);
    until("it is suspended", || (state("desk-left")? == "suspended").then_some(()));
    let info = &node("desk-left").unwrap()["info"];
    for (key, value) in [("media.class", "Video/Source"), ("media.role", "Camera"), ("node.description", "Desk, left")]
    {
        assert_eq!(info["props"][key], value, "{key}");
    }
    let formats = info["params"]["EnumFormat"].as_array().unwrap();
    assert_eq!(formats.len(), 1, "{formats:?}");
    let format = &formats[0];
    assert_eq!((&format["mediaSubtype"], &format["format"]), (&"raw".into(), &"YUY2".into()));
    assert_eq!(format["size"], serde_json::json!({ "width": SIZE.0, "height": SIZE.1 }), "one size, and no choice");
    assert_eq!(format["framerate"], serde_json::json!({ "num": FPS, "denom": 1 }));
    // A second node of the same name gets a suffix, and nodes disappear with their programs.
    let other = Player::start("desk-left-2", &["--to", "pipewire:Desk, left"]);
    assert_eq!(other.end()["pipewire"][0]["node"], "desk-left-2");
    let report = player.end();
    assert!(report["sink"].as_str().unwrap().starts_with("PipeWire camera desk-left (Desk, left)"), "{report}");
    assert_eq!(report["pipewire"][0]["shown"], 0, "nobody watched");
    until("the nodes to go", || (node("desk-left").is_none() && node("desk-left-2").is_none()).then_some(()));
}

/// Returns the distance from each picture to the previous one, modulo the loop length.
fn steps(numbers: &[usize]) -> Vec<usize> {
    numbers.windows(2).map(|pair| (pair[1] + PICTURES - pair[0]) % PICTURES).collect()
}

/// Asserts that a reader gets the pictures in order, and that the report counts repeats and losses. Their number
/// depends on the machine's speed.
fn is_accounted_for(report: &Value, frames: &[Vec<u8>]) {
    let (numbers, count) = (numbers(frames), |value: &Value| value.as_u64().unwrap() as usize);
    let (node, steps) = (&report["pipewire"][0], steps(&numbers));
    let again = frames.len() - numbers.len() + steps.iter().filter(|step| **step == 0).count();
    assert!(again <= count(&node["repeats"]), "{again} again: {node}, {steps:?}");
    let missed: usize = steps.iter().map(|step| step.saturating_sub(1)).sum();
    let dropped: usize = report["frames"]["dropped"].as_object().unwrap().values().map(count).sum();
    let lost = dropped + count(&node["overtaken"]) + count(&node["no_buffer"]);
    println!("{again} again, {missed} missed: {node}, {}", report["frames"]);
    assert!(missed <= lost, "{missed} missed: {node}, {}, {steps:?}", report["frames"]);
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn readers_get_each_picture_as_it_is_in_order_and_with_its_time() {
    folder();
    let player = Player::start("bokehcam", &["--to", "pipewire"]);
    let got = GStreamer::start("bokehcam", 60).end();
    assert_eq!(got.frames.len(), 60);
    assert!(got.sequence.windows(2).all(|pair| pair[1] == pair[0] + 1), "{:?}", got.sequence);
    let numbers = numbers(&got.frames);
    let times_ns = &got.times_ns[got.frames.len() - numbers.len()..];
    assert!(times_ns.windows(2).all(|pair| pair[0] < pair[1]), "{times_ns:?}");
    // A picture's time stamp is its due time. After a repeat of a late picture, it is later.
    let steps = steps(&numbers);
    let is_new = |at: usize| at == 0 || steps[at - 1] > 0;
    let own: Vec<usize> = (1..numbers.len()).filter(|&at| is_new(at) && is_new(at - 1)).collect();
    let period_ns = 1e9 / f64::from(FPS);
    for pair in own.windows(2) {
        let due = (numbers[pair[1]] + PICTURES - numbers[pair[0]]) % PICTURES;
        let periods = (times_ns[pair[1]] - times_ns[pair[0]]) as f64 / period_ns;
        // The recording may have looped several times.
        let off = (periods - due as f64 + 0.5).rem_euclid(PICTURES as f64) - 0.5;
        assert!(off.abs() < 0.15, "{off} periods off: {numbers:?}, {times_ns:?}");
    }
    let report = player.end();
    assert!(report["pipewire"][0]["shown"].as_u64() >= Some(steps.iter().filter(|step| **step > 0).count() as u64));
    is_accounted_for(&report, &got.frames);
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn pictures_that_are_yuyv_already_come_as_they_are_between_others() {
    folder();
    let mut sink = PipeWire::open(Some("Ready"), &Options::new(SIZE, 1_000_000_000 / u64::from(FPS))).unwrap();
    assert!(sink.wants_yuyv());
    let mut reader = GStreamer::start("ready", 40);
    let mut ready = YuyvImage::default();
    let mut order = (0..PICTURES).cycle();
    until("the reader's last picture", || {
        let number = order.next()?;
        let picture = picture(number);
        let flow = if number % 2 == 0 {
            sink.write_frame(&picture, 0)
        } else {
            ready.resize(SIZE.0, SIZE.1);
            ready.bytes.copy_from_slice(&yuyv(&picture));
            sink.write_yuyv(&mut ready, 0)
        };
        assert!(flow.unwrap().is_continue());
        std::thread::sleep(Duration::from_secs(1) / FPS);
        (!reader.is_reading()).then_some(())
    });
    let numbers = numbers(&reader.end().frames);
    assert!([0, 1].iter().all(|form| numbers.iter().any(|number| number % 2 == *form)), "{numbers:?}");
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn two_readers_at_once_get_every_picture() {
    folder();
    let player = Player::start("bokehcam", &["--to", "pipewire"]);
    // More pictures than it reads during the other reader's run.
    let mut first = GStreamer::start("bokehcam", 100_000);
    until("the first one reads", || (first.frames().len() > 20).then_some(()));
    // A busy machine may hold one of them up; then the second one reads again.
    let (frames, second) = until("neither reader delays the other", || {
        let before = first.frames().len();
        let second = GStreamer::start("bokehcam", 90).end();
        assert!(first.is_reading(), "they read at the same time");
        let frames = first.frames();
        println!("{} pictures and {}", frames.len() - before, second.frames.len());
        (frames.len() >= before + 60).then_some((frames, second))
    });
    drop(first);
    let report = player.end();
    is_accounted_for(&report, &frames);
    is_accounted_for(&report, &second.frames);
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_reader_comes_after_the_session_manager_has_suspended_the_node() {
    folder();
    let player = Player::start("bokehcam", &["--to", "pipewire"]);
    numbers(&GStreamer::start("bokehcam", 20).end().frames);
    until("it is suspended", || (state("bokehcam")? == "suspended").then_some(()));
    numbers(&GStreamer::start("bokehcam", 20).end().frames);
    player.end();
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_program_of_before_pipewire_reads_by_pw_v4l2() {
    let player = Player::start("bokehcam", &["--to", "pipewire"]);
    let to = folder().join("old.yuv");
    let size = format!("{}x{}", SIZE.0, SIZE.1);
    let read = Command::new("timeout")
        .args(["120", "pw-v4l2", "ffmpeg", "-loglevel", "error", "-y", "-f", "v4l2", "-input_format", "yuyv422"])
        .args(["-video_size", &size, "-i", "/dev/video0", "-frames:v", "20", "-f", "rawvideo"])
        .arg(&to)
        .output()
        .unwrap();
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let frames: Vec<Vec<u8>> =
        std::fs::read(&to).unwrap().chunks(2 * (SIZE.0 * SIZE.1) as usize).map(<[u8]>::to_vec).collect();
    assert_eq!(frames.len(), 20);
    numbers(&frames);
    player.end();
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn the_camera_outlives_the_daemon() {
    folder();
    let player = Player::start("bokehcam", &["--to", "pipewire"]);
    // This reader would wait for ever after the daemon's end, so it is killed.
    let reader = GStreamer::start("bokehcam", 1000);
    until("a reader", || (state("bokehcam")? == "running").then_some(()));
    kill("pipewire");
    drop(reader);
    until("the node again", || node("bokehcam"));
    // The session manager, which connects readers, must be back, too.
    until("the session manager", || {
        let told = Command::new("pw-cli").args(["ls", "Client"]).output().unwrap();
        String::from_utf8_lossy(&told.stdout).contains("WirePlumber").then_some(())
    });
    numbers(&GStreamer::start("bokehcam", 30).end().frames);
    let report = player.end();
    assert_eq!(report["pipewire"][0]["returns"], 1, "{}", report["pipewire"]);
}

/// Watches a recording's pictures for being opened (inotify).
struct Openings(std::os::fd::OwnedFd);

impl Openings {
    fn of(folder: &std::path::Path) -> Self {
        let watch = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC).unwrap();
        inotify::add_watch(&watch, folder, inotify::WatchFlags::OPEN).unwrap();
        Self(watch)
    }

    /// Whether any picture was opened since the last call.
    fn any(&self) -> bool {
        let mut events = [0; 4096];
        let mut any = false;
        while rustix::io::read(&self.0, &mut events).is_ok_and(|bytes| bytes > 0) {
            any = true;
        }
        any
    }
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn off_is_off_for_readers_while_another_output_hangs() {
    folder();
    let place = tempfile::tempdir().unwrap();
    let video = place.path().join("call.mp4");
    let player = Player::start("hung", &["--to", "pipewire:Hung", "--to", video.to_str().unwrap(), "--name", "hung"]);
    let reader = GStreamer::start("hung", 1_000_000);
    let known: Vec<Vec<u8>> = (0..PICTURES).map(|number| yuyv(&picture(number))).collect();
    until("the reader's first pictures", || reader.frames().last().filter(|last| known.contains(last)).map(|_| ()));
    let signal = |signal: &str, process: &str| Command::new("kill").args([signal, process]).status().unwrap();
    let ffmpeg = player.child();
    assert!(signal("-STOP", &ffmpeg).success());
    let mut last = Vec::new();
    for _ in 0..8 {
        last = until("another picture", || reader.frames().pop().filter(|frame| *frame != last));
    }
    let off = Ran::of(&mut bokehcam(&["ctl", "--name", "hung", "off"]));
    assert!(off.done().contains("call.mp4: busy"), "{}", off.stderr);
    let before = reader.frames().len();
    // The reader may still have been writing pictures when the answer came.
    let cards = until("the card, and more pictures", || {
        let frames = reader.frames().split_off(before);
        let card = frames.iter().position(|frame| !known.contains(frame))?;
        (frames.len() > card + 4).then(|| frames[card..].to_vec())
    });
    assert!(cards.iter().all(|frame| *frame == cards[0]), "nothing but the card");
    let stat = std::fs::read_to_string(format!("/proc/{ffmpeg}/stat")).unwrap();
    assert!(stat.contains(" T "), "it still hangs: {stat}");
    assert!(signal("-CONT", &ffmpeg).success());
    // The card is not a frame of the source, so the node got more pictures than were delivered.
    drop(player);
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn the_source_is_read_only_while_somebody_watches() {
    folder();
    let player = Player::start("bokehcam", &["--to", "pipewire", "--on-demand"]);
    let opened = Openings::of(&player.pictures());
    std::thread::sleep(Duration::from_secs(1));
    assert!(!opened.any(), "nobody watches");
    let (mut watched, mut read) = (Duration::ZERO, 0);
    for _ in 0..2 {
        let began = Instant::now();
        let reader = GStreamer::start("bokehcam", 45);
        until("a picture", || opened.any().then_some(()));
        read += steps(&numbers(&reader.end().frames)).iter().filter(|step| **step > 0).count() as u64;
        // Frames in flight are still read.
        let mut last = Instant::now();
        until("nobody watches any more", || {
            if opened.any() {
                last = Instant::now();
            }
            (last.elapsed() > Duration::from_secs(2)).then_some(())
        });
        watched += last - began;
    }
    let report = player.end();
    let captured = report["frames"]["captured"].as_u64().unwrap();
    let most = (watched.as_secs_f64() * f64::from(FPS)) as u64 + 10;
    assert!((read..=most).contains(&captured), "{captured} captured where {read} were read, in {watched:?}");
}

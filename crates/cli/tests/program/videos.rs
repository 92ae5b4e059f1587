//! Video files, and y4m on standard input, as sources of the whole program.

use std::fs;
use std::process::{Command, Stdio};

use crate::program::{Home, PROGRAM, Ran, json};

/// Returns a home with a clip of two seconds and 40 frames, with sound.
fn home_with_clip() -> Home {
    let home = Home::new();
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", "testsrc=s=64x48:r=20:d=2", "-f", "lavfi", "-i", "sine=d=2"]);
    ffmpeg.args(["-c:v", "libx264", "-pix_fmt", "yuv420p", "-c:a", "aac"]).arg(home.path("clip.mp4"));
    Ran::of(&mut ffmpeg).done();
    home
}

/// Returns the codec and the length, rounded to tenths of a second, of each stream of a file.
fn streams(home: &Home, file: &str) -> Vec<(String, u32)> {
    let mut probe = Command::new("ffprobe");
    probe.args(["-v", "error", "-of", "csv=p=0", "-show_entries", "stream=codec_name,duration"]).arg(home.path(file));
    let text = Ran::of(&mut probe).printed();
    let stream = |line: &str| {
        let (codec, length_s) = line.split_once(',').unwrap();
        (codec.to_owned(), (length_s.trim_end_matches(',').parse::<f64>().unwrap() * 10.0).round() as u32)
    };
    text.lines().map(stream).collect()
}

#[test]
fn y4m_passes_through_a_pipe() {
    let home = Home::new();
    let both = format!("'{PROGRAM}' -q stream synthetic --size 61x47 --frames 5 --effect none --to - | '{PROGRAM}' -q");
    let pipe = |args: &str| Ran::of(home.within(Command::new("sh")).args(["-c", &format!("{both} {args}")]));
    for to in ["one.y4m", "two.y4m"] {
        pipe(&format!("stream - --effect none --to {to}")).done();
    }
    let [one, two] = ["one.y4m", "two.y4m"].map(|name| fs::read(home.path(name)).unwrap());
    assert!(one == two && one.windows(6).filter(|bytes| bytes == b"FRAME\n").count() == 5);
    pipe("record - --frames 3 --to take").done();
    assert_eq!(fs::read_dir(home.path("take/rgb")).unwrap().count(), 3);
    for (args, said) in [("--start 1", "--start"), ("--loop", "--loop"), ("--depth stereo", "--depth stereo")] {
        pipe(&format!("stream - {args} --to null")).refused(2, &[said]);
    }
}

#[test]
fn a_wrong_header_is_one_line() {
    let home = Home::new();
    for (header, said) in [("", "yuv4mpegpipe"), ("RIFF\\n", "YUV4MPEG2"), ("YUV4MPEG2 W4 H4 C420p10\\n", "C420p10")] {
        let script = format!("printf '{header}' | '{PROGRAM}' stream - --to null");
        Ran::of(home.within(Command::new("sh")).args(["-c", &script])).refused(1, &["standard input: ", said]);
    }
}

#[test]
fn without_ffmpeg_a_video_is_one_line() {
    let home = Home::new();
    fs::write(home.path("clip"), b"\0\0\0\x0cftypisom").unwrap();
    for command in ["stream clip --to null", "record clip --to take"] {
        Ran::of(&mut home.shell("PATH=/nowhere;", command)).refused(1, &["clip", "install the package ffmpeg"]);
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn sound_stays_with_its_part_of_the_pictures() {
    let home = home_with_clip();
    let video = |name: &str, length| (name.to_owned(), length);
    for (args, length) in [("", 20), ("--start 0.5 --end 1.5", 10), ("--frames 12", 6), ("--start 1.5 --size 32x24", 5)]
    {
        home.run(
            &[&["stream", "clip.mp4", "--effect", "none", "--force", "--to", "out.mp4"][..], &words(args)].concat(),
        )
        .done();
        let found = streams(&home, "out.mp4");
        assert_eq!((found.len(), &found[0]), (2, &video("h264", length)), "{args}");
        assert!(found[1].0 == "aac" && found[1].1.abs_diff(length) <= 1, "{args}: {found:?}");
    }
    for (args, said) in
        [("--to out.webm", "without the sound"), ("--loop --frames 50 --to loop.mp4", "without its sound")]
    {
        let ran = home.run(&[&["stream", "clip.mp4", "--effect", "none"][..], &words(args)].concat());
        assert!(ran.warning().contains(said), "{}", ran.stderr);
    }
    assert_eq!(streams(&home, "loop.mp4"), [video("h264", 25)]);
    assert!(home.path("out.webm").exists());
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_transport_stream_has_the_pictures_of_the_same_video_in_mp4() {
    let home = home_with_clip();
    // The sound begins before the pictures.
    let mut remux = Command::new("ffmpeg");
    let clip = home.path("clip.mp4");
    remux.args(["-v", "error", "-i"]).arg(&clip).args(["-itsoffset", "0.4", "-i"]).arg(&clip);
    remux.args(["-map", "1:v", "-map", "0:a", "-c", "copy"]).arg(home.path("late.ts"));
    Ran::of(&mut remux).done();
    let read = |name: &str| {
        let dir = home.path(name).join("rgb");
        (0..).map_while(|frame| fs::read(dir.join(format!("{frame:06}.png"))).ok()).collect::<Vec<_>>()
    };
    for (args, count) in [("", 40), ("--start 0.5", 30), ("--start 0.62 --end 1.11", 10)] {
        for (from, to) in [("clip.mp4", "mp4"), ("late.ts", "ts")] {
            home.run(&[&["record", from, "--to", to, "--force"], &*words(args)].concat()).done();
        }
        assert!(read("ts") == read("mp4"), "{args}");
        assert_eq!(read("ts").len(), count, "{args}");
    }
}

fn words(text: &str) -> Vec<&str> {
    text.split_whitespace().collect()
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_is_blurred_the_same_twice_and_a_cut_one_is_kept_up_to_its_cut() {
    let home = home_with_clip();
    for to in ["one.y4m", "two.y4m"] {
        home.run(&["stream", "clip.mp4", "--effect", "blur", "--pace", "asap", "--to", to]).done();
    }
    assert!(fs::read(home.path("one.y4m")).unwrap() == fs::read(home.path("two.y4m")).unwrap());

    let mut remux = Command::new("ffmpeg");
    remux.args(["-v", "error", "-i"]).arg(home.path("clip.mp4")).args(["-c", "copy"]).arg(home.path("clip.mkv"));
    Ran::of(&mut remux).done();
    let whole = fs::read(home.path("clip.mkv")).unwrap();
    fs::write(home.path("cut.mkv"), &whole[..whole.len() / 2]).unwrap();
    let cut = ["stream", "cut.mkv", "--effect", "none", "--to", "cut.y4m"];
    home.run(&cut).failed(1, &["cut.mkv: damaged or cut short after"]);
    assert!(home.path("cut.y4m").exists());
    let ran = home.run(&[&cut[..], &["--keep-going", "--force"]].concat());
    assert!(ran.warning().contains("cut short"), "{}", ran.stderr);
    home.run(&["stream", "clip.mp4", "--effect", "none", "--to", "clip.mp4", "--force"]).refused(2, &["--to"]);
}

/// A cut at an open group of pictures makes ffmpeg report an error, though every picture is there.
#[test]
#[ignore = "needs ffmpeg"]
fn an_error_of_ffmpeg_without_a_loss_is_a_warning() {
    let home = Home::new();
    let ffmpeg = |arguments: &str| {
        Ran::of(Command::new("ffmpeg").current_dir(home.0.path()).args(["-v", "error"]).args(words(arguments))).done();
    };
    ffmpeg("-f lavfi -i testsrc=s=64x48:r=20:d=3 -c:v libx264 -x264-params open-gop=1:keyint=12:bframes=3 whole.ts");
    ffmpeg("-ss 1.03 -i whole.ts -c copy part.ts");
    let ran = home.run(&["stream", "part.ts", "--effect", "none", "--to", "part.y4m"]);
    assert!(ran.warning().contains("ffmpeg says \"mmco: unref short failure"), "{}", ran.stderr);
    let frames = fs::read(home.path("part.y4m")).unwrap().windows(6).filter(|bytes| bytes == b"FRAME\n").count();
    assert!(ran.warning().contains(&format!("all of its {frames} pictures are there")) && frames > 30, "{frames}");
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_killed_run_leaves_no_decoder() {
    let home = home_with_clip();
    let mut run = crate::program::Beside::start(
        home.command(&["-q", "stream", "clip.mp4", "--loop", "--pace", "realtime", "--to", "null"])
            .stderr(Stdio::null()),
    );
    let decoder =
        crate::program::found("it decodes", std::time::Duration::from_secs(60), || run.children().first().copied());
    run.signal(rustix::process::Signal::KILL);
    let gone = || fs::read(format!("/proc/{}/cmdline", decoder.as_raw_nonzero())).map_or(true, |line| line.is_empty());
    crate::program::until("the decoder ends", std::time::Duration::from_secs(60), gone);
    // A killed program of many threads ends after the first of them, at whose end its decoder was told to.
    crate::program::until("the run ends", std::time::Duration::from_secs(60), || !run.runs());
}

/// Its name is that of a video, but its content names other files.
#[test]
#[ignore = "needs ffmpeg"]
fn a_list_of_videos_is_not_read_whatever_its_name() {
    let home = home_with_clip();
    let ffmpeg = |arguments: &str| {
        Ran::of(Command::new("ffmpeg").current_dir(home.0.path()).args(["-v", "error"]).args(words(arguments))).done();
    };
    ffmpeg("-i clip.mp4 -c copy secret.ts");
    for (name, content, format) in [
        ("hls.mp4", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1.0,\nsecret.ts\n#EXT-X-ENDLIST\n", "hls"),
        ("concat.mp4", "ffconcat version 1.0\nfile secret.ts\n", "concat"),
        (
            "session.mp4",
            "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n",
            "sdp",
        ),
    ] {
        fs::write(home.path(name), content).unwrap();
        let said = [name, &format!("({format})"), "give the video itself"];
        home.run(&["stream", name, "--to", "null"]).refused(1, &said);
        home.run(&["record", name, "--to", "take"]).refused(1, &said);
        assert!(!home.path("take").exists());
    }
    // Videos of all usual kinds are read.
    for name in "a.mov a.mkv a.webm a.avi a.ts a.mpg a.flv a.ogv a.wmv a.y4m a.gif a.3gp".split(' ') {
        let size = if name == "a.3gp" { "176x144" } else { "64x48" };
        ffmpeg(&format!(
            "-i clip.mp4 -an -r 25 -t 0.4 -vf scale={}:flags=neighbor,format=yuv420p {name}",
            size.replace('x', ":")
        ));
        let ran = home.run(&["stream", name, "--effect", "none", "--to", "null"]);
        assert!(ran.code == 0, "{name}: {}", ran.stderr);
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn the_processor_time_of_ffmpeg_is_in_the_report() {
    let home = home_with_clip();
    let cpu_s = |path: &str, name: &str| {
        let args = ["stream", "clip.mp4", "--effect", "none", "--to", "null", "--report", name];
        Ran::of(home.command(&args).env("PATH", path)).done();
        json(home.path(name))["cpu_s"].as_f64().unwrap()
    };
    let usual_s = cpu_s(&std::env::var("PATH").unwrap(), "usual.json");
    let ffmpeg = Ran::of(Command::new("sh").args(["-c", "command -v ffmpeg"])).printed();
    let work = "i=0; while [ $i -lt 1000000 ]; do i=$((i+1)); done";
    let slow_s = cpu_s(&home.add_program("ffmpeg", &format!("{work}; exec {} \"$@\"", ffmpeg.trim())), "slow.json");
    assert!(slow_s > usual_s + 0.2, "{slow_s} s with an ffmpeg that works for long, {usual_s} s without");
}

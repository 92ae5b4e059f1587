//! Refused requests change nothing and do not delay others.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use super::world::{HANG, World, answer, until};

#[test]
fn a_setting_that_cannot_be_changes_none() {
    let world = World::new();
    let _stream = world.stream("stream", &["--to", "null"]);
    let before = world.status(&[])["look"].clone();
    for (args, said) in [
        (&["set", "rim=0.5", "highlights=-1"][..], "invalid value '-1' for '--highlights <M>'"),
        (&["set", "rim=0.5", "rimm=1"], "there is no setting 'rimm' of the look, did you mean rim?"),
        (&["set", "rim=0.5", "blurr=3%"], "there is no setting 'blurr' of the look, did you mean blur?"),
        (&["set", "rim=0.5", "out-size=1x1"], "there is no setting 'out-size' of the look: nothing else"),
        (&["set", "depth=matte"], "nothing else can be changed while it runs"),
        (&["set", "preset=dreamy"], "`bokehcam ctl preset dreamy`"),
        (&["set", "--blur", "3%"], "written without dashes, such as `bokehcam ctl set blur=3%`"),
        (&["set", "rim=0.5", "behind=image:no.png"], "here/no.png"),
        (&["set", "rim=0.5", "f-number=2"], "a lens needs all of"),
        (&["set", "blur=3%", "f-number=2"], "cannot be used with"),
        (&["set", "rim=0.5", "blur=90000"], "use pixels from 0 to 20000"),
        (&["set", "rim=0.5", "blur=19000"], "a blur radius of 19000 px is too large"),
        (&["set", "rim=0.5", "aperture=image:no.png"], "here/no.png"),
        (&["set", "rim"], "write NAME=VALUE"),
        (&["preset", "nice"], "there is no preset 'nice': use portrait"),
    ] {
        world.ctl(args).refused(if said.contains("no.png") { 1 } else { 2 }, &[said]);
        assert_eq!(world.status(&[])["look"], before, "{args:?}");
    }
    // The message is that of the command line.
    let flag = world.run(&["stream", "demo", "--to", "null", "--rim", "2"]);
    assert_eq!(world.ctl(&["set", "rim=2"]).refused(2, &[]), flag.refused(2, &[]));
    for args in [&["dance"][..], &["set"], &["status", "--name", "../x"]] {
        assert_eq!(world.ctl(args).code, 2, "{args:?}");
    }
}

#[test]
fn what_is_no_request_is_answered_so() {
    let world = World::new();
    let _stream = world.stream("stream", &["--to", "null"]);
    for (request, said) in [
        (&b"on\n"[..], "this is not a valid request"),
        (b"{\"do\":\"dance\"}\n", "unknown variant `dance`"),
        (b"{\"do\":\"set\",\"settings\":[\"rim=0.1\"],\"force\":true}\n", "unknown field `force`"),
        (b"{\"do\":\"set\",\"settings\":{}}\n", "this is not a valid request"),
        (b"\xff\xfe\n", "this is not a valid request"),
        (b"\n", "this is not a valid request"),
        (b"{\"do\":\"snapshot\",\"to\":\"x.png\"}\n", "give the absolute path"),
        (&[b' '; 20_000], "too long: 16384 bytes"),
        (&[b"{\"do\":\"preset\",\"name\":\"".as_slice(), &[b'x'; 60_000], b"\"}\n"].concat(), "too long"),
    ] {
        let answer = world.tell("stream", request);
        let value: serde_json::Value = serde_json::from_str(&answer).unwrap_or_else(|_| panic!("{answer:?}"));
        assert_eq!(value["usage"], true, "{answer}");
        assert!(value["error"].as_str().unwrap().contains(said), "{answer}");
    }
    // The longest valid request, and one byte more.
    let longest = |bytes: usize| {
        let mut request = br#"{"do":"status"}"#.to_vec();
        request.resize(bytes - 1, b' ');
        request.push(b'\n');
        world.tell("stream", &request)
    };
    assert!(longest(16_384).contains("\"status\""));
    assert!(longest(16_385).contains("too long"));
    // End of file without a newline.
    let mut stream = UnixStream::connect(world.socket("stream")).unwrap();
    stream.write_all(b"{\"do\":\"off\"}").unwrap();
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    assert!(answer(&stream).contains("the request is incomplete"));
    assert_eq!(world.status(&[])["on"], true);
}

#[test]
fn who_says_nothing_holds_nobody_up() {
    let world = World::new();
    let _stream = world.stream("stream", &["--to", "null"]);
    let connect = || UnixStream::connect(world.socket("stream")).unwrap();
    // Each client has a timeout of 1 s, so that serial handling would take 6 s. An earlier client may still occupy one
    // of the eight slots, and a busy machine may need another try.
    until("six say nothing, and a seventh is served all the same", || {
        let began = Instant::now();
        let silent: Vec<UnixStream> = (0..6).map(|_| connect()).collect();
        let is_served = world.tell("stream", b"{\"do\":\"status\"}\n").contains("\"on\":true");
        let took = began.elapsed();
        // All answers are awaited: by then, the slots are free for another try.
        let late = silent.iter().filter(|stream| answer(stream).contains("did not arrive within 1 s")).count();
        is_served && late == silent.len() && took < Duration::from_secs(1)
    });
    // Clients above the limit are refused at once. Slots become free when the first clients time out after 1 s.
    until("most are told at once that there is no room", || {
        let silent: Vec<UnixStream> = (0..20).map(|_| connect()).collect();
        let answers: Vec<String> = silent.iter().map(answer).collect();
        let refused = answers.iter().filter(|answer| answer.contains("too many requests at once")).count();
        let late = answers.iter().filter(|answer| answer.contains("did not arrive within 1 s")).count();
        assert_eq!(refused + late, 20, "{answers:?}");
        refused >= 12 && late >= 7
    });
    assert_eq!(world.status(&[])["on"], true);
    // A request in pieces must still be complete within 1 s.
    let began = Instant::now();
    let mut slow = connect();
    for byte in b"{\"do\":\"off\"}            " {
        std::thread::sleep(Duration::from_millis(100));
        if slow.write_all(&[*byte]).is_err() {
            break;
        }
    }
    assert!(answer(&slow).contains("did not arrive within 1 s") && began.elapsed() >= Duration::from_secs(1));
    assert_eq!(world.status(&[])["on"], true);
}

#[test]
fn who_asks_while_too_many_do_is_told_so_and_never_cut_off() {
    let world = World::new();
    let _stream = world.stream("stream", &["--to", "null"]);
    until("somebody came while there was no room", || {
        let _silent: Vec<UnixStream> = (0..8).map(|_| UnixStream::connect(world.socket("stream")).unwrap()).collect();
        let ran: Vec<_> = (0..4).map(|_| world.ctl(&["status"])).collect();
        let refused: Vec<&str> = ran.iter().filter(|ran| ran.code != 0).map(|ran| ran.stderr.as_str()).collect();
        assert!(refused.iter().all(|said| said.contains("too many requests at once: try again")), "{refused:?}");
        !refused.is_empty()
    });
}

#[test]
fn each_of_two_hundred_at_once_gets_an_answer() {
    let world = World::new();
    let _stream = world.stream("stream", &["--to", "null"]);
    let answers: Vec<String> = std::thread::scope(|scope| {
        let ask = || world.tell("stream", b"{\"do\":\"toggle\"}\n");
        let all: Vec<_> = (0..200).map(|_| scope.spawn(ask)).collect();
        all.into_iter().map(|asked| asked.join().unwrap()).collect()
    });
    let refused = answers.iter().filter(|answer| answer.contains("too many requests at once")).count();
    let done = answers.iter().filter(|answer| answer.starts_with('{') && !answer.contains("\"error\"")).count();
    assert_eq!(refused + done, 200, "{answers:?}");
    until("every answer was true", || world.status(&[])["on"] == (done % 2 == 0));
    let told: Vec<_> = std::thread::scope(|scope| {
        let all: Vec<_> = (0..40).map(|_| scope.spawn(|| world.ctl(&["toggle"]))).collect();
        all.into_iter().map(|asked| asked.join().unwrap()).collect()
    });
    for ran in told {
        assert!(ran.code == 0 || ran.stderr.contains("too many requests at once"), "{}", ran.stderr);
    }
}

#[test]
fn a_run_that_takes_up_nobody_is_said_to_hang() {
    use std::os::unix::fs::DirBuilderExt;
    let world = World::new();
    std::fs::DirBuilder::new().mode(0o700).create(world.path("run/bokehcam")).unwrap();
    let _nobody = std::os::unix::net::UnixListener::bind(world.socket("stream")).unwrap();
    world.ctl(&["status"]).refused(1, &["stream does not answer: it hangs, or is still starting"]);
}

#[test]
fn a_start_does_not_wait_for_a_lock_that_nobody_gives_back() {
    let world = World::new();
    world.run(&["stream", "demo", "--frames", "1", "--to", "null"]);
    let folder = std::fs::File::open(world.path("run/bokehcam")).unwrap();
    rustix::fs::flock(&folder, rustix::fs::FlockOperation::LockExclusive).unwrap();
    let ran = world.run(&["stream", "demo", "--frames", "2", "--pace", "realtime", "--to", "null"]);
    let said = ran.done();
    assert!(said.contains("`bokehcam ctl` cannot reach this stream") && said.contains("is locked"), "{said}");
}

#[test]
fn a_run_that_ends_waits_for_no_client() {
    let world = World::new();
    let stream = world.stream("stream", &["--to", "null"]);
    let _silent: Vec<UnixStream> = (0..4).map(|_| UnixStream::connect(world.socket("stream")).unwrap()).collect();
    let began = Instant::now();
    assert_eq!(stream.interrupt(), 0);
    assert!(began.elapsed() < HANG, "{:?}", began.elapsed());
    assert!(!world.socket("stream").exists());
}

#[test]
#[ignore = "needs root: only root can be somebody else"]
fn another_user_is_refused_even_where_the_folder_is_open() {
    use std::fs::{Permissions, set_permissions};
    use std::os::unix::fs::PermissionsExt;
    let world = World::new();
    let _stream = world.stream("stream", &["--to", "null"]);
    let nobody = rustix::process::Uid::from_raw(65534);
    let socket = world.socket("stream");
    // Changes the user id of this thread only.
    let ask = move || {
        std::thread::spawn(move || {
            rustix::thread::set_thread_res_uid(nobody, nobody, nobody).unwrap();
            let mut stream = UnixStream::connect(&socket)?;
            let _ = stream.write_all(b"{\"do\":\"off\"}\n");
            Ok::<String, std::io::Error>(answer(&stream))
        })
        .join()
        .unwrap()
    };
    let denied = ask.clone()().unwrap_err();
    assert_eq!(denied.kind(), std::io::ErrorKind::PermissionDenied, "the folder keeps others out");
    for (path, mode) in [("", 0o755), ("run", 0o755), ("run/bokehcam", 0o755), ("run/bokehcam/stream.sock", 0o777)] {
        set_permissions(world.path(path), Permissions::from_mode(mode)).unwrap();
    }
    assert!(ask().unwrap().contains("this run belongs to another user"));
    set_permissions(world.path("run/bokehcam"), Permissions::from_mode(0o700)).unwrap();
    assert_eq!(world.status(&[])["on"], true);
}

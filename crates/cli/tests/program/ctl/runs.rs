//! Names of runs: several runs, killed ones, and none.

use std::fs::{self, Permissions};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::UnixListener;

use crate::program::{PORTRAIT, Ran};

use super::world::World;

#[test]
fn several_runs_are_told_apart_by_name() {
    let world = World::new();
    world.ctl(&["on"]).refused(1, &["no stream or preview is running"]);
    for list in [&[][..], &["list"]] {
        let ran = world.ctl(list);
        assert!(ran.stdout.is_empty() && ran.done().contains("nothing is running"), "{}", ran.stderr);
    }
    let first = world.stream("stream", &["--to", "null"]);
    let second = world.stream("stream-2", &["--to", "null"]);
    let _third = world.stream("desk", &["--to", "null", "--name", "desk"]);
    world.ctl(&["off"]).refused(2, &["several are running: desk, stream, stream-2; choose one with --name"]);
    world.ctl(&["off", "--name", "stream-2"]).done();
    for list in [&[][..], &["list"]] {
        let listed = world.ctl(list).printed();
        let [desk, stream, second] = listed.lines().collect::<Vec<_>>()[..] else { panic!("{listed}") };
        assert!(
            desk.starts_with("desk ") && stream.starts_with("stream ") && second.starts_with("stream-2 "),
            "{listed}"
        );
        assert!(
            desk.contains(" on ") && second.contains(" off ") && desk.ends_with("recordings/portrait to null"),
            "{listed}"
        );
    }
    assert_eq!(world.ctl(&["--name", "desk"]).printed().lines().count(), 1);
    let on = |name: &str| world.status(&["--name", name])["on"].clone();
    assert_eq!([on("desk"), on("stream"), on("stream-2")], [true, true, false]);
    world.ctl(&["on", "--name", "sofa"]).refused(1, &["no run is called sofa: there is desk, stream, stream-2"]);
    let taken = world.run(&["stream", PORTRAIT, "--to", "out/", "--frames", "3", "--name", "desk"]);
    taken.refused(2, &["another run is called desk already: choose another --name"]);
    assert!(!world.path("here/out").exists());

    let mode = |path: &str| fs::metadata(world.path(path)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("run/bokehcam"), 0o700);
    assert_eq!((first.interrupt(), second.interrupt()), (0, 0));
    assert!(!world.socket("stream").exists() && !world.socket("stream-2").exists(), "a run takes its socket with it");
    assert_eq!(world.status(&[])["name"], "desk");
}

#[test]
fn what_a_dead_run_left_is_swept_and_nothing_else_is_touched() {
    let world = World::new();
    let mut killed = world.stream("stream", &["--to", "null"]);
    killed.0.kill().unwrap();
    killed.0.wait().unwrap();
    assert!(world.socket("stream").symlink_metadata().unwrap().file_type().is_socket());
    world.ctl(&["off"]).refused(1, &["no stream or preview is running"]);
    world.ctl(&["off", "--name", "stream"]).refused(1, &["no run is called stream: nothing is running"]);

    let foreign = [world.path("run/bokehcam/notes.txt"), world.socket("stream-2"), world.socket("desk")];
    for file in &foreign {
        fs::write(file, "mine").unwrap();
    }
    let alive = UnixListener::bind(world.socket("other")).unwrap();
    // The name of a killed run is free again; one taken by a regular file is not.
    let first = world.stream("stream", &["--to", "null"]);
    let second = world.stream("stream-3", &["--to", "null"]);
    let refused = world.run(&["stream", "demo", "--frames", "1", "--to", "null", "--name", "desk"]);
    refused.refused(2, &["desk.sock exists and does not belong to a run"]);
    assert_eq!((first.interrupt(), second.interrupt()), (0, 0));
    for file in &foreign {
        assert_eq!(fs::read_to_string(file).unwrap(), "mine");
    }
    assert!(world.socket("other").exists(), "somebody listens there");
    drop(alive);

    // A run does not remove a file that has replaced its socket.
    let stream = world.stream("stream", &["--to", "null"]);
    fs::remove_file(world.socket("stream")).unwrap();
    fs::write(world.socket("stream"), "mine").unwrap();
    assert_eq!(stream.interrupt(), 0);
    assert_eq!(fs::read_to_string(world.socket("stream")).unwrap(), "mine");
}

#[test]
fn without_a_folder_of_the_users_own_a_run_goes_on_and_says_so() {
    let world = World::new();
    let args = ["stream", PORTRAIT, "--frames", "3", "--to", "null", "--pace", "realtime"];
    let said = |world: &World, folder: Option<&str>, more: &[&str]| {
        let mut command = world.bokehcam(&[&args, more].concat());
        match folder {
            Some(folder) => command.env("XDG_RUNTIME_DIR", folder),
            None => command.env_remove("XDG_RUNTIME_DIR"),
        };
        let ran = Ran::of(&mut command);
        let lines = ran.done().lines().filter(|line| line.contains("bokehcam ctl"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    let none = said(&world, None, &[]);
    assert!(none.len() == 1 && none[0].contains("XDG_RUNTIME_DIR is not an absolute path"), "{none:?}");
    assert!(said(&world, None, &["--quiet"]).is_empty());
    assert!(said(&world, Some("/nowhere"), &[])[0].contains("XDG_RUNTIME_DIR is /nowhere"));
    assert!(
        said(&world, Some("here"), &[])[0].contains("XDG_RUNTIME_DIR is not an absolute path"),
        "a path that is not whole is none"
    );
    assert!(said(&world, world.path("run").to_str(), &[]).is_empty());
    fs::set_permissions(world.path("run/bokehcam"), Permissions::from_mode(0o755)).unwrap();
    let open = said(&world, world.path("run").to_str(), &[]);
    assert!(open.len() == 1 && open[0].contains("is accessible to others: run `chmod 700"), "{open:?}");
    world.ctl(&["status"]).refused(1, &["is accessible to others"]);
    fs::remove_dir(world.path("run/bokehcam")).unwrap();
    std::os::unix::fs::symlink(world.path("here"), world.path("run/bokehcam")).unwrap();
    assert!(said(&world, world.path("run").to_str(), &[])[0].contains("is not a folder"));
    assert_eq!(fs::read_dir(world.path("here")).unwrap().count(), 0);
}

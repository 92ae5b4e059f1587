//! Outputs that are removed or moved while they are written.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::ChildStderr;

use super::home::*;

/// Starts a run into `d/NAME` and a folder; waits until both have content.
fn run(home: &Home, path: &str, name: &str) -> (Beside, BufReader<ChildStderr>) {
    let args = format!("stream self {BLUR} --loop --pace realtime --to d/{name} --to out/");
    let mut run = home.start(path, &args);
    let stderr = BufReader::new(run.0.stderr.take().unwrap());
    until("pictures", || {
        // The first ones may still be in an encoder.
        home.path("out/000012.png").exists()
            && part(&home.path("d")).is_some_and(|part| part.metadata().unwrap().len() > 0)
    });
    (run, stderr)
}

/// Finds the unfinished file in a folder.
fn part(folder: &Path) -> Option<std::path::PathBuf> {
    let mut there = fs::read_dir(folder).ok()?.map(|entry| entry.unwrap().path());
    there.find(|path| path.extension().is_some_and(|extension| extension == "part"))
}

/// Reads up to a line that contains `what`.
#[track_caller]
fn line_with(stderr: &mut impl BufRead, what: &str) -> String {
    stderr.lines().map(Result::unwrap).find(|line| line.contains(what)).unwrap_or_else(|| panic!("never said: {what}"))
}

#[test]
fn an_output_that_is_removed_is_told_of_while_the_others_go_on_and_what_there_is_is_kept() {
    let home = Home::new();
    home.record("self", 4, 0.03);
    // The fake encoder keeps writing into its open file, as ffmpeg does.
    let path = home.fake_ffmpeg("[ \"$1\" = -version ] && exit\nexec cat > \"$out\"");
    for (name, whole_folder) in [("x.y4m", true), ("x.y4m", false), ("x.mkv", true), ("x.mp4", true)] {
        let (run, mut stderr) = run(&home, &path, name);
        match whole_folder {
            true => fs::remove_dir_all(home.path("d")).unwrap(),
            false => fs::remove_file(part(&home.path("d")).unwrap()).unwrap(),
        }
        let told = line_with(&mut stderr, "was removed while it was being written");
        let kept = home.path(if whole_folder { "" } else { "d" }).join(name.replace('.', ".incomplete."));
        let kept_at = format!("kept as {}", kept.canonicalize().unwrap().display());
        assert!(told.contains(&kept_at) && told.contains("continuing without it"), "{told}");
        assert_eq!(home.path("d").exists(), !whole_folder, "it is not made anew");
        let so_far = pngs(&home.path("out"));
        until("more pictures of the other", || pngs(&home.path("out")) > so_far);
        assert_eq!(terminate(run).code, 1);
        line_with(&mut stderr, "error: d/x.");
        assert!(fs::metadata(&kept).unwrap().len() > 4608);
        if name == "x.y4m" {
            assert!(frames(&kept) > 0);
        }
        fs::remove_file(&kept).unwrap();
        fs::remove_dir_all(home.path("out")).unwrap();
    }
}

#[test]
fn an_output_whose_folder_is_moved_is_kept_where_it_is() {
    let home = Home::new();
    home.record("self", 4, 0.03);
    let (run, mut stderr) = run(&home, "", "x.y4m");
    fs::rename(home.path("d"), home.path("e")).unwrap();
    // A new folder of the same name does not receive the output.
    fs::create_dir(home.path("d")).unwrap();
    assert_eq!(terminate(run).code, 1);
    let told = line_with(&mut stderr, "error: ");
    assert!(told.contains("e/x.incomplete.y4m"), "{told}");
    assert!(frames(&home.path("e/x.incomplete.y4m")) > 0);
    assert_eq!(fs::read_dir(home.path("e")).unwrap().count(), 1, "nothing hidden is left");
    assert_eq!(fs::read_dir(home.path("d")).unwrap().count(), 0);
}

#[test]
fn a_folder_that_is_removed_ends_the_run() {
    let home = Home::new();
    home.record("self", 4, 0.05);
    let args = format!("stream self {BLUR} --loop --pace realtime --to out/");
    let run = home.start("", &args);
    until("a picture", || home.path("out/000001.png").exists());
    fs::rename(home.path("out"), home.path("away")).unwrap();
    fs::remove_dir_all(home.path("away")).unwrap();
    run.end(LONG).failed(1, &["out"]);
    assert!(!home.path("out").exists());
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_that_is_removed_can_be_played_up_to_there() {
    let home = Home::new();
    home.record("self", 4, 0.03);
    for name in ["x.mp4", "x.mkv", "x.webm"] {
        let (run, mut stderr) = run(&home, "", name);
        fs::remove_dir_all(home.path("d")).unwrap();
        line_with(&mut stderr, "was removed while it was being written");
        assert_eq!(terminate(run).code, 1);
        let frames = played(&home.path(name.replace('.', ".incomplete.")));
        assert!(frames >= 2, "{name}: {frames}");
        fs::remove_dir_all(home.path("out")).unwrap();
    }
}

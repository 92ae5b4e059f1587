//! A recording through `gst-launch-1.0` gives the output of `bokehcam stream`, to the bit.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use bokehcam_media::recording::still::read_color;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Creates a folder with only the plugin.
fn plugins(home: &Path) -> PathBuf {
    let (name, folder) = ("libgstbokehcam.so", home.join("plugins"));
    // Cargo builds it beside this program.
    let built = std::env::current_exe().unwrap().with_file_name(name);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::copy(built, folder.join(name)).unwrap();
    folder
}

/// Runs a GStreamer command line in the folder `home`, and returns its output.
fn run(command: &str, home: &Path) -> String {
    let mut shell = Command::new("bash");
    shell.args(["-c", command]).current_dir(home);
    shell.env("GST_PLUGIN_PATH", plugins(home)).env("GST_REGISTRY", home.join("registry.bin"));
    let output = shell.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !errors.contains("ERROR"), "{command}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_recording_is_what_stream_makes_of_it() {
    let (dir, recording) = (tempfile::tempdir().unwrap(), repository().join("recordings/portrait"));
    let (streamed, launched) = (dir.path().join("streamed"), dir.path().join("launched"));
    // An empty file keeps the user's settings out of the test.
    let settings = dir.path().join("config.toml");
    std::fs::write(&settings, "").unwrap();
    let mut arguments: Vec<OsString> =
        ["bokehcam", "stream", "--quiet", "--pace", "asap", "--highlights", "12"].map(Into::into).into();
    arguments.extend(["--coc-at-infinity", "14", "--to"].map(OsString::from));
    arguments.extend([format!("{}/", streamed.display()).into(), recording.clone().into()]);
    arguments.extend(["--config".into(), settings.into()]);
    let code = bokehcam_cli::run(arguments);
    assert_eq!(format!("{code:?}"), format!("{:?}", ExitCode::SUCCESS));

    std::fs::create_dir(&launched).unwrap();
    let source = |folder: &str| {
        format!(
            "multifilesrc location={}/{folder}/%06d.png caps=image/png,framerate=12/1 ! pngdec",
            recording.display()
        )
    };
    run(
        &format!(
            "gst-launch-1.0 -q bokeh name=b highlights=12 coc-at-infinity=14 depth-scale=5000 \
             ! videoconvert ! pngenc ! multifilesink location={}/%06d.png \
             {} ! videoconvert ! video/x-raw,format=RGB ! queue ! b.sink \
             {} ! videoconvert ! video/x-raw,format=GRAY16_LE ! queue ! b.depth",
            launched.display(),
            source("rgb"),
            source("depth")
        ),
        dir.path(),
    );
    let mut names: Vec<_> = std::fs::read_dir(&launched).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names.len(), std::fs::read_dir(recording.join("rgb")).unwrap().count());
    for name in names {
        let [theirs, ours] = [&launched, &streamed].map(|folder| read_color(&folder.join(&name)).unwrap());
        let off = theirs.rgb.iter().zip(&ours.rgb).filter(|(theirs, ours)| theirs != ours).count();
        assert_eq!((theirs.size(), off), (ours.size(), 0), "{}", name.display());
    }
}

#[test]
fn the_element_is_described() {
    let home = tempfile::tempdir().unwrap();
    let text = run("gst-inspect-1.0 bokeh", home.path());
    for part in ["Background blur", "'depth'", "On request", "Distance of the focal plane", "tilt-shift", "MIT/X11"] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
}

#[test]
fn the_pipelines_of_the_pages_run() {
    let home = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(repository().join("recordings"), home.path().join("recordings")).unwrap();
    std::fs::create_dir(home.path().join("blurred")).unwrap();
    let page = std::fs::read_to_string(repository().join("docs/gstreamer.md")).unwrap();
    let text = page.replace("\\\n", " ");
    let commands = text.lines().filter(|line| line.starts_with("gst-launch-1.0 "));
    // Not every machine has cameras and screens.
    let (left_out, ran): (Vec<&str>, Vec<&str>) =
        commands.partition(|line| ["/dev/video", "autovideosink"].iter().any(|part| line.contains(part)));
    ran.iter().for_each(|command| drop(run(command, home.path())));
    assert_eq!((left_out.len(), ran.len()), (2, 3), "{text}");
}

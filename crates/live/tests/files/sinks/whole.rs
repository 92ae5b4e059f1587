//! Files that appear whole, and frames that are kept.

use std::fs;

use bokehcam_live::sink::{Ending, SinkError};

use super::{PERIOD_NS, flat, forced, listing, open, options, picture, put_all};

#[test]
fn a_file_appears_only_when_it_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("made/clip.y4m");
    let frames: Vec<_> = (0..3).map(|frame| picture(6, 4, frame)).collect();

    let mut given_up = open(&name, &options((6, 4))).unwrap();
    put_all(&mut *given_up, &frames);
    assert!(!name.exists());
    drop(given_up);
    assert_eq!(listing(name.parent().unwrap()), ["clip.incomplete.y4m"], "frames are kept");
    fs::remove_file(folder.path().join("made/clip.incomplete.y4m")).unwrap();
    drop(open(&name, &options((6, 4))).unwrap());
    assert!(listing(name.parent().unwrap()).is_empty(), "nothing is left of nothing");

    let mut sink = open(&name, &options((6, 4))).unwrap();
    put_all(&mut *sink, &frames);
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(listing(name.parent().unwrap()), ["clip.y4m"]);
    let header = b"YUV4MPEG2 W6 H4 F25:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
    assert_eq!(fs::read(&name).unwrap().len(), header.len() + 3 * (6 + 24 + 12), "header and three frames of 4:2:0");

    assert!(matches!(open(&name, &options((6, 4))), Err(SinkError::Exists { .. })));
    let mut sink = open(&name, &forced((6, 4))).unwrap();
    put_all(&mut *sink, &frames[..1]);
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(fs::read(&name).unwrap().len(), header.len() + 42);
}

#[test]
fn what_appeared_meanwhile_is_not_overwritten_and_the_frames_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    let mut sink = open(&name, &options((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 0)]);
    fs::write(&name, "mine").unwrap();
    let error = sink.finish(Ending::Complete).unwrap_err();
    let SinkError::Kept { error, kept } = &error else { panic!("{error}") };
    assert!(matches!(**error, SinkError::Exists { .. }), "{error}");
    assert_eq!(fs::read(&name).unwrap(), b"mine");
    assert!(fs::read(kept).unwrap().starts_with(b"YUV4MPEG2"));
    assert_eq!(listing(folder.path()), ["clip.incomplete.y4m", "clip.y4m"]);
}

#[test]
fn what_was_cut_short_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    for (there, expected) in [(false, vec!["clip.y4m"]), (true, vec!["clip.incomplete.y4m", "clip.y4m"])] {
        if there {
            fs::write(&name, "old").unwrap();
        }
        let mut sink = open(&name, &forced((6, 4))).unwrap();
        put_all(&mut *sink, &[picture(6, 4, 0)]);
        sink.finish(Ending::Truncated).unwrap();
        assert_eq!(listing(folder.path()), expected);
    }
    assert_eq!(fs::read(&name).unwrap(), b"old");
}

#[test]
fn two_that_write_one_file_never_mix() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    let [mut one, mut two] = [0, 1].map(|_| open(&name, &options((6, 4))).unwrap());
    for frame in 0..3 {
        for (sink, grey) in [(&mut one, 0), (&mut two, 255)] {
            assert!(sink.write_frame(&flat(6, 4, [grey; 3]), frame * PERIOD_NS).unwrap().is_continue());
        }
    }
    one.finish(Ending::Complete).unwrap();
    assert!(matches!(two.finish(Ending::Complete), Err(SinkError::Kept { .. })));
    let has = |name: &str, luma: u8| {
        let bytes = fs::read(folder.path().join(name)).unwrap();
        bytes.split(|byte| *byte == b'\n').filter(|part| part.len() > 24 && part.starts_with(&[luma; 24])).count()
    };
    assert_eq!([has("clip.y4m", 16), has("clip.y4m", 235)], [3, 0]);
    assert_eq!([has("clip.incomplete.y4m", 16), has("clip.incomplete.y4m", 235)], [0, 3]);
}

#[test]
fn part_files_of_others_and_links_there_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("victim"), "mine").unwrap();
    for link in [".clip.y4m.part", ".000000.png.part"] {
        std::os::unix::fs::symlink(at("victim"), at(link)).unwrap();
    }
    fs::write(at(".other.y4m.part"), "mine").unwrap();
    for name in ["clip.y4m", "other.y4m"] {
        let mut sink = open(&at(name), &options((6, 4))).unwrap();
        put_all(&mut *sink, &[picture(6, 4, 0)]);
        sink.finish(Ending::Complete).unwrap();
        assert!(!at(name).is_symlink());
    }
    assert_eq!(fs::read(at("victim")).unwrap(), b"mine");
    assert_eq!(fs::read(at(".other.y4m.part")).unwrap(), b"mine");
}

#[test]
fn what_a_killed_run_left_is_kept_under_a_name_that_shows() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at(".clip.y4m.77-0.part"), "take").unwrap();
    fs::write(at(".clip.y4m.78-0.part"), "").unwrap();
    let mut sink = open(&at("clip.y4m"), &options((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 0)]);
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(listing(folder.path()), ["clip.incomplete.y4m", "clip.y4m"]);
    assert_eq!(fs::read(at("clip.incomplete.y4m")).unwrap(), b"take");
}

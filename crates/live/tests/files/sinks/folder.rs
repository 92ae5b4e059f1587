//! Numbered pictures in a folder.

use std::fs;

use bokehcam::frame::ColorImage;
use bokehcam_files::folder::FolderError;
use bokehcam_live::sink::{Ending, SinkError};

use super::{PERIOD_NS, forced, listing, open, options, picture, put_all};

#[test]
fn pictures_are_numbered_and_exact() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("made/out/");
    let frames: Vec<_> = (0..3).map(|frame| picture(17, 13, frame)).collect();
    let mut sink = open(&out.join(""), &options((17, 13))).unwrap();
    put_all(&mut *sink, &frames);
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(listing(&out), [".bokehcam", "000000.png", "000001.png", "000002.png"]);
    for (name, frame) in listing(&out)[1..].iter().zip(&frames) {
        assert_eq!(image::open(out.join(name)).unwrap().into_rgb8().into_raw(), frame.rgb);
    }
}

#[test]
fn a_folder_is_replaced_only_by_force_and_only_if_it_was_written_by_us() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut sink = open(&out.join(""), &options((6, 4))).unwrap();
    put_all(&mut *sink, &[0, 1, 2].map(|frame| picture(6, 4, frame)));
    sink.finish(Ending::Complete).unwrap();
    let not_empty = open(&out.join(""), &options((6, 4))).err().unwrap();
    assert!(matches!(not_empty, SinkError::Folder(FolderError::NotEmpty { .. })), "{not_empty}");
    for name in ["7.png", "notes.txt"] {
        fs::write(out.join(name), "mine").unwrap();
        let foreign = open(&out.join(""), &forced((6, 4))).err().unwrap();
        assert!(matches!(foreign, SinkError::Folder(FolderError::Foreign { .. })), "{foreign}");
        assert_eq!(fs::read(out.join(name)).unwrap(), b"mine");
        fs::remove_file(out.join(name)).unwrap();
    }

    let old = fs::read(out.join("000000.png")).unwrap();
    let mut sink = open(&out.join(""), &forced((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 5)]);
    assert_eq!(fs::read(out.join("000000.png")).unwrap(), old, "the old ones stay until the new are whole");
    sink.finish(Ending::Truncated).unwrap();
    assert_eq!(fs::read(out.join("000000.png")).unwrap(), old);
    assert_eq!(listing(&folder.path().join("out.incomplete")), [".bokehcam", "000000.png"]);

    let mut sink = open(&out.join(""), &forced((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 5), picture(6, 4, 6)]);
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(listing(&out), [".bokehcam", "000000.png", "000001.png"], "no tail of the old ones");
    assert_ne!(fs::read(out.join("000000.png")).unwrap(), old);
}

#[test]
fn a_failed_picture_leaves_no_partial_name() {
    let folder = tempfile::tempdir().unwrap();
    // Fewer bytes than its size claims: the encoder fails after the file was created. Or the next name is taken.
    let broken = ColorImage { width: 0, height: 4, rgb: Vec::new() };
    for (name, next, taken) in [("broken", &broken, false), ("taken", &picture(6, 4, 1), true)] {
        let out = folder.path().join(name);
        let mut sink = open(&out.join(""), &options((6, 4))).unwrap();
        put_all(&mut *sink, &[picture(6, 4, 0)]);
        if taken {
            fs::create_dir(out.join("000001.png")).unwrap();
        }
        let error = sink.write_frame(next, PERIOD_NS).unwrap_err();
        assert_eq!(matches!(error, SinkError::Folder(FolderError::Foreign { .. })), taken, "{error}");
        sink.finish(Ending::Truncated).unwrap();
        let expected: &[&str] = if taken { &["000000.png", "000001.png"] } else { &["000000.png"] };
        assert_eq!(listing(&out)[1..], *expected);
    }
}

#[test]
fn a_folder_that_is_moved_away_gets_no_more_pictures_and_another_of_its_name_none() {
    let folder = tempfile::tempdir().unwrap();
    let (out, away) = (folder.path().join("out"), folder.path().join("away"));
    let mut sink = open(&out.join(""), &options((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 0)]);
    fs::rename(&out, &away).unwrap();
    fs::create_dir(&out).unwrap();
    let error = sink.write_frame(&picture(6, 4, 1), PERIOD_NS).unwrap_err();
    assert!(error.to_string().contains("was removed or moved meanwhile"), "{error}");
    sink.finish(Ending::Truncated).unwrap();
    assert_eq!((listing(&out).len(), listing(&away)), (0, vec![".bokehcam".to_owned(), "000000.png".to_owned()]));
}

#[test]
fn a_folder_that_is_removed_is_an_error_and_not_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut sink = open(&out.join(""), &options((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 0)]);
    fs::remove_dir_all(&out).unwrap();
    let error = sink.write_frame(&picture(6, 4, 1), PERIOD_NS).unwrap_err();
    assert!(error.to_string().contains("was removed or moved meanwhile"), "{error}");
    assert!(!out.exists());
}

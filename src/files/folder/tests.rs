use std::io::Write;
use std::os::unix::fs::symlink;

use super::*;

const SET: FileSet = FileSet {
    subfolders: &["rgb"],
    contains: &|name| name.ends_with(".png") && name.bytes().any(|byte| byte.is_ascii_digit()) || name == "rgb.txt",
};

fn open(path: &Path) -> Result<Folder, FolderError> {
    Folder::open(path, true, &SET)
}

fn put(folder: &mut Folder, name: &str, text: &str) {
    let part = folder.create_file(name).unwrap();
    part.file().write_all(text.as_bytes()).unwrap();
    folder.commit_file(part).unwrap();
}

/// Returns all files as `name=content`, including subfolders, sorted, without our own list.
fn all(path: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_str().unwrap().to_owned();
        match entry.is_dir() {
            true => found.extend(all(&entry).into_iter().map(|file| format!("{name}/{file}"))),
            false if name == LIST_NAME => {}
            false => found.push(format!("{name}={}", fs::read_to_string(&entry).unwrap_or_default())),
        }
    }
    found.sort();
    found
}

fn write(path: &Path, names: &[(&str, &str)]) {
    let mut folder = open(path).unwrap();
    names.iter().for_each(|(name, text)| put(&mut folder, name, text));
    folder.finish().unwrap();
}

#[test]
fn files_go_into_an_empty_folder_as_they_come() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a/out/");
    let mut folder = Folder::open(&path, false, &SET).unwrap();
    put(&mut folder, "0.png", "zero");
    assert_eq!(all(&path), ["0.png=zero"]);
    assert!(matches!(Folder::open(&path, true, &SET), Err(FolderError::Busy { .. })), "one run at a time");
    put(&mut folder, "rgb/0.png", "deep");
    assert_eq!((folder.file_count(), folder.finish().unwrap()), (2, 0));
    assert_eq!(all(&path), ["0.png=zero", "rgb/0.png=deep"]);
    assert!(matches!(Folder::open(&path, false, &SET), Err(FolderError::NotEmpty { .. })));

    // Files removed by others leave an empty list, which is no obstacle.
    fs::remove_file(path.join("0.png")).unwrap();
    fs::remove_dir_all(path.join("rgb")).unwrap();
    drop(Folder::open(&path, false, &SET).unwrap());
    assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
}

#[test]
fn what_was_there_stays_until_the_new_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    write(&path, &[("0.png", "old"), ("1.png", "old"), ("rgb/2.png", "old"), ("rgb.txt", "old")]);
    fs::write(path.join("notes.txt"), "mine").unwrap();
    fs::write(path.join("holiday.png"), "mine").unwrap();
    let before = all(&path);

    let mut folder = open(&path).unwrap();
    assert!(folder.is_replacing());
    put(&mut folder, "0.png", "new");
    let hidden = |files: &[String]| files.iter().filter(|file| !file.starts_with('.')).cloned().collect::<Vec<_>>();
    assert_eq!(hidden(&all(&path)), before);
    put(&mut folder, "7.png", "new");
    assert_eq!(folder.finish().unwrap(), 4);
    assert_eq!(all(&path), ["0.png=new", "7.png=new", "holiday.png=mine", "notes.txt=mine"]);
    assert!(!path.join("rgb").exists());

    let mut folder = open(&path).unwrap();
    put(&mut folder, "0.png", "cut");
    assert_eq!(folder.finish_incomplete().unwrap(), Some(dir.path().join("out.incomplete")));
    assert_eq!(all(&path), ["0.png=new", "7.png=new", "holiday.png=mine", "notes.txt=mine"]);
    assert_eq!(all(&dir.path().join("out.incomplete")), ["0.png=cut"]);
    assert_eq!(open(&path).unwrap().finish_incomplete().unwrap(), None, "nothing is kept of nothing");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
}

#[test]
fn foreign_files_are_refused_and_never_touched() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    write(&path, &[("0.png", "old")]);
    for name in ["1.png", "rgb/5.png"] {
        fs::create_dir_all(path.join(name).parent().unwrap()).unwrap();
        fs::write(path.join(name), "mine").unwrap();
        let error = open(&path).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("not written by bokehcam"), "{error}");
        fs::remove_file(path.join(name)).unwrap();
    }
    // A foreign file that appears meanwhile.
    let mut folder = open(&path).unwrap();
    put(&mut folder, "1.png", "new");
    fs::write(path.join("1.png"), "mine").unwrap();
    assert!(matches!(folder.finish(), Err(FolderError::Foreign { .. })));
    assert_eq!(all(&path), ["0.png=old", "1.png=mine"]);
    assert_eq!(all(&dir.path().join("out.incomplete")), ["1.png=new"]);

    // A forged list, and a link in place of a subfolder.
    let other = dir.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("3.png"), "mine").unwrap();
    fs::remove_file(path.join("1.png")).unwrap();
    fs::remove_dir(path.join("rgb")).unwrap();
    let elsewhere = other.join("4.png");
    fs::write(&elsewhere, "mine").unwrap();
    let names = format!("0.png\n../other/3.png\n{}\nrgb/3.png\n..\n.hidden\n\n", elsewhere.display());
    fs::write(path.join(LIST_NAME), names).unwrap();
    symlink(&other, path.join("rgb")).unwrap();
    assert!(matches!(open(&path), Err(FolderError::Foreign { .. })), "it would be written through a link");
    let plain = FileSet { subfolders: &[], contains: SET.contains };
    assert_eq!(Folder::open(&path, true, &plain).unwrap().finish().unwrap(), 1);
    assert_eq!(all(&other), ["3.png=mine", "4.png=mine"]);
}

#[test]
fn a_folder_that_goes_meanwhile_is_not_made_anew() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    for again in [false, true] {
        let mut folder = open(&path).unwrap();
        put(&mut folder, "0.png", "new");
        fs::remove_dir_all(&path).unwrap();
        if again {
            fs::create_dir(&path).unwrap();
        }
        assert!(matches!(folder.create_file("1.png"), Err(FolderError::Gone { .. })));
    }
}

#[test]
fn what_a_killed_run_left_is_kept_or_done_with() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    write(&path, &[("0.png", "old"), ("1.png", "old")]);
    let leave = |folder: &str, files: &[&str], names: &str| {
        let folder = path.join(folder);
        fs::create_dir(&folder).unwrap();
        files.iter().for_each(|name| fs::write(folder.join(name), "new").unwrap());
        fs::write(folder.join(LIST_NAME), names).unwrap();
    };
    // Killed while writing.
    leave(STAGING_NAME, &["0.png"], "0.png\n");
    fs::write(path.join(".1.png.77-0.part"), "half").unwrap();
    fs::write(path.join(".mine.77-0.part"), "half").unwrap();
    drop(open(&path).unwrap());
    assert_eq!(all(&path), [".mine.77-0.part=half", "0.png=old", "1.png=old"]);
    assert_eq!(all(&dir.path().join("out.incomplete")), ["0.png=new"]);
    // Killed before anything was written.
    leave(STAGING_NAME, &[], "");
    drop(open(&path).unwrap());
    assert!(!dir.path().join("out.incomplete.2").exists());
    // Killed while moving files: two of three are in place, and ours.
    ["0.png", "2.png"].iter().for_each(|name| fs::write(path.join(name), "new").unwrap());
    list::List::open(&path).unwrap().add("2.png").unwrap();
    leave(STAGING_NAME, &["3.png"], "0.png\n2.png\n3.png\n");
    drop(open(&path).unwrap());
    assert_eq!(all(&path), [".mine.77-0.part=half", "0.png=new", "1.png=old", "2.png=new"]);
    assert_eq!(all(&dir.path().join("out.incomplete.2")), ["3.png=new"]);
    write(&path, &[("2.png", "newer")]);
    assert_eq!(all(&path), [".mine.77-0.part=half", "2.png=newer"]);
}

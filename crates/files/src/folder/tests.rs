use std::os::unix::fs::symlink;

use super::*;

fn open(path: &Path) -> Result<Folder, FolderError> {
    Folder::open(path, true)
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
    let mut folder = Folder::open(&path, false).unwrap();
    put(&mut folder, "0.png", "zero");
    assert_eq!(all(&path), ["0.png=zero"]);
    assert!(matches!(open(&path), Err(FolderError::Busy { .. })), "one run at a time");
    put(&mut folder, "rgb/0.png", "deep");
    assert_eq!(folder.finish().unwrap(), 0);
    assert_eq!(all(&path), ["0.png=zero", "rgb/0.png=deep"]);
    assert!(matches!(Folder::open(&path, false), Err(FolderError::NotEmpty { .. })));

    // Files removed by others leave an empty list, which is no obstacle.
    fs::remove_file(path.join("0.png")).unwrap();
    fs::remove_dir_all(path.join("rgb")).unwrap();
    drop(Folder::open(&path, false).unwrap());
    assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
}

#[test]
fn what_was_there_stays_until_the_new_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    let kept = dir.path().join("out.incomplete");
    write(&path, &[("0.png", "old"), ("1.png", "old"), ("rgb/2.png", "old"), ("rgb.txt", "old")]);
    let before = all(&path);

    let mut folder = open(&path).unwrap();
    put(&mut folder, "0.png", "new");
    put(&mut folder, "7.png", "new");
    assert_eq!((all(&path), all(&kept)), (before, vec!["0.png=new".to_owned(), "7.png=new".to_owned()]));
    assert_eq!(folder.finish().unwrap(), 4);
    assert_eq!(all(&path), ["0.png=new", "7.png=new"]);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);

    let mut folder = open(&path).unwrap();
    put(&mut folder, "0.png", "cut");
    assert_eq!(folder.finish_incomplete().unwrap(), Some(kept.clone()));
    assert_eq!((all(&path), all(&kept)), (vec!["0.png=new".into(), "7.png=new".into()], vec!["0.png=cut".to_owned()]));
    assert_eq!(open(&path).unwrap().finish_incomplete().unwrap(), None, "nothing is kept of nothing");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);

    // Through a link, the folder is replaced, and not the link.
    let link = dir.path().join("link");
    symlink(&path, &link).unwrap();
    write(&link, &[("3.png", "newer")]);
    assert!(link.is_symlink());
    assert_eq!(all(&path), ["3.png=newer"]);
}

#[test]
fn foreign_files_are_refused_and_never_touched() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    write(&path, &[("0.png", "old")]);
    for name in ["1.png", ".take.mp4.77-0.part", "rgb/5.png", "notes.txt", "a/b/c/notes.txt", ".hidden"] {
        fs::create_dir_all(path.join(name).parent().unwrap()).unwrap();
        fs::write(path.join(name), "mine").unwrap();
        let error = open(&path).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("not written by bokehcam"), "{error}");
        assert_eq!(fs::read(path.join(name)).unwrap(), b"mine");
        fs::remove_file(path.join(name)).unwrap();
    }
    // A foreign file that appears meanwhile.
    let mut folder = open(&path).unwrap();
    put(&mut folder, "1.png", "new");
    fs::write(path.join("1.png"), "mine").unwrap();
    assert!(matches!(folder.finish(), Err(FolderError::Foreign { .. })));
    assert_eq!(all(&path), ["0.png=old", "1.png=mine"]);
    assert_eq!(all(&dir.path().join("out.incomplete")), ["1.png=new"]);
    fs::remove_file(path.join("1.png")).unwrap();
    let old = own_files(&path).unwrap();
    fs::write(path.join("2.png"), "mine").unwrap();
    remove_own(&path, &old).unwrap();
    assert_eq!(all(&path), ["2.png=mine"], "what appears last of all stays, too");
    fs::remove_file(path.join("2.png")).unwrap();

    // A folder without a list, such as that of another program, and a list that names files elsewhere.
    let other = dir.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("3.png"), "mine").unwrap();
    assert!(matches!(open(&other), Err(FolderError::Foreign { .. })));
    fs::write(path.join(LIST_NAME), "0.png\n../other/3.png\nrgb\n").unwrap();
    symlink(&other, path.join("rgb")).unwrap();
    write(&path, &[("2.png", "new")]);
    assert_eq!((all(&path), all(&other)), (vec!["2.png=new".to_owned()], vec!["3.png=mine".to_owned()]));
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
fn what_a_killed_run_left_is_ours() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    write(&path, &[("0.png", "old")]);
    fs::write(path.join(".1.png.77-0.part"), "half").unwrap();
    // A name that was cut off by a full disk.
    list_file(&path, "1.p").unwrap();
    list_file(&path, "2.png").unwrap();
    fs::write(path.join("2.png"), "old").unwrap();
    write(&path, &[("2.png", "newer")]);
    assert_eq!(all(&path), ["2.png=newer"]);
}

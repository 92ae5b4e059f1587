use std::os::unix::fs::{PermissionsExt, symlink};

use super::*;

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_file_appears_whole_or_not_at_all() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.txt");
    let part = PartFile::create(&path).unwrap();
    part.file().write_all(b"one").unwrap();
    assert!(!path.exists());
    assert_eq!((bytes_written(&path), bytes_written(&dir.path().join("b.txt"))), (Some(3), None));
    drop(part);
    assert_eq!(bytes_written(&path), None);
    assert_eq!(names(dir.path()), Vec::<String>::new());

    write(&path, b"one", false).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
    assert_eq!(write(&path, b"two", false).unwrap_err().kind(), ErrorKind::AlreadyExists);
    assert_eq!(fs::read(&path).unwrap(), b"one");
    write(&path, b"two", true).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"two");
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    assert_eq!(names(dir.path()), ["a.txt"]);
}

#[test]
fn two_writers_of_one_name_never_mix() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.y4m");
    let (one, two) = (PartFile::create(&path).unwrap(), PartFile::create(&path).unwrap());
    one.file().write_all(b"one").unwrap();
    two.file().write_all(b"two").unwrap();
    one.commit(false).unwrap();
    assert_eq!(two.commit(false).unwrap_err().kind(), ErrorKind::AlreadyExists);
    assert_eq!((names(dir.path()), fs::read(&path).unwrap()), (vec!["a.y4m".to_owned()], b"one".to_vec()));
}

#[test]
fn parts_left_behind_are_found_and_no_others() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mkv");
    let alive = PartFile::create(&path).unwrap();
    let left = dir.path().join(".a.mkv.77-0.part");
    let foreign = [".a.mkv.part", ".a.mkv.7.part", ".a.mkv.x-1.part", ".b.mkv.7-1.part", "a.mkv.7-1.part"];
    fs::write(&left, "take").unwrap();
    for name in foreign {
        fs::write(dir.path().join(name), "").unwrap();
    }
    symlink(dir.path().join("b"), dir.path().join(".a.mkv.8-0.part")).unwrap();
    assert_eq!(find_abandoned(&path).unwrap(), std::slice::from_ref(&left));
    let kept = keep_incomplete(&left, &path).unwrap();
    assert_eq!(kept, dir.path().join("a.incomplete.mkv"));
    alive.file().write_all(b"more").unwrap();
    assert_eq!(alive.keep_incomplete().unwrap(), dir.path().join("a.incomplete.2.mkv"));
    assert_eq!(fs::read(dir.path().join("a.incomplete.mkv")).unwrap(), b"take");
}

#[test]
fn a_link_in_the_way_is_never_written_through() {
    let dir = tempfile::tempdir().unwrap();
    let victim = dir.path().join("victim");
    fs::write(&victim, "mine").unwrap();
    let path = dir.path().join("a.png");
    symlink(&victim, &path).unwrap();
    assert_eq!(write(&path, b"new", false).unwrap_err().kind(), ErrorKind::AlreadyExists);
    write(&path, b"new", true).unwrap();
    assert_eq!((fs::read(&victim).unwrap(), fs::read(&path).unwrap()), (b"mine".to_vec(), b"new".to_vec()));
}

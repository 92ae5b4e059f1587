//! Suggestions for mistyped names of folders.

use std::path::{Path, PathBuf};

use crate::names::find_similar;

/// Returns the sibling folder of `path` with the most similar name, if one is similar enough.
pub fn find_similar_folder(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let parent = path.parent().unwrap_or(Path::new(""));
    let listed = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let folders = std::fs::read_dir(listed).ok()?.filter_map(|entry| entry.ok()).filter(|entry| entry.path().is_dir());
    find_similar(name, folders.filter_map(|folder| folder.file_name().into_string().ok()))
        .map(|other| parent.join(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_pen_is_found_and_another_word_is_not() {
        let home = tempfile::tempdir().unwrap();
        for name in ["portrait", "stereo"] {
            std::fs::create_dir(home.path().join(name)).unwrap();
        }
        assert_eq!(find_similar_folder(&home.path().join("portrat")), Some(home.path().join("portrait")));
        assert_eq!(find_similar_folder(&home.path().join("Steroe/")), Some(home.path().join("stereo")));
        assert_eq!(find_similar_folder(&home.path().join("holiday")), None);
        assert_eq!(find_similar_folder(Path::new("/nowhere/at/all")), None);
    }
}

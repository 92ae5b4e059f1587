//! Suggestions for mistyped names of files and folders.

use std::path::{Path, PathBuf};

use bokehcam::names;

/// Returns the sibling of `path` with the most similar name among those that `is_it`, if one is similar enough.
pub fn find_similar(path: &Path, is_it: fn(&Path) -> bool) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let parent = path.parent().unwrap_or(Path::new(""));
    let listed = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let siblings = std::fs::read_dir(listed).ok()?.filter_map(|entry| entry.ok()).filter(|entry| is_it(&entry.path()));
    names::find_similar(name, siblings.filter_map(|sibling| sibling.file_name().into_string().ok()))
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
        std::fs::write(home.path().join("portrait.mp4"), "").unwrap();
        let find_similar_folder = |path: &Path| find_similar(path, Path::is_dir);
        assert_eq!(find_similar_folder(&home.path().join("portrat")), Some(home.path().join("portrait")));
        assert_eq!(find_similar_folder(&home.path().join("Steroe/")), Some(home.path().join("stereo")));
        assert_eq!(find_similar_folder(&home.path().join("holiday")), None);
        assert_eq!(find_similar_folder(Path::new("/nowhere/at/all")), None);
        let file = find_similar(&home.path().join("portrai.mp4"), Path::is_file);
        assert_eq!(file, Some(home.path().join("portrait.mp4")));
    }
}

//! Suggestions for mistyped names.

use std::path::{Path, PathBuf};

/// Least Jaro-Winkler similarity (0 to 1) of a name that is suggested: one or two slips in a word of usual length.
const SIMILAR: f64 = 0.8;

/// Of some words the one that is most like a text, if any is similar enough.
pub fn word<'a>(text: &str, words: &[&'a str]) -> Option<&'a str> {
    let rated = words.iter().map(|word| (strsim::jaro_winkler(&text.to_lowercase(), word), *word));
    rated.filter(|(similarity, _)| *similarity >= SIMILAR).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, word)| word)
}

/// The existing sibling of `path` that is a folder of the most similar name, if any is similar enough.
pub fn folder(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let parent = path.parent().unwrap_or(Path::new(""));
    let listed = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let folders = std::fs::read_dir(listed).ok()?.filter_map(|entry| entry.ok()).filter(|entry| entry.path().is_dir());
    let similarity = |other: &str| strsim::jaro_winkler(&name.to_lowercase(), &other.to_lowercase());
    let names = folders.filter_map(|folder| folder.file_name().into_string().ok());
    let rated = names.map(|other| (similarity(&other), other)).filter(|(similarity, _)| *similarity >= SIMILAR);
    rated.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, other)| parent.join(other))
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
        assert_eq!(folder(&home.path().join("portrat")), Some(home.path().join("portrait")));
        assert_eq!(folder(&home.path().join("Steroe/")), Some(home.path().join("stereo")));
        assert_eq!(folder(&home.path().join("holiday")), None);
        assert_eq!(folder(Path::new("/nowhere/at/all")), None);
    }
}

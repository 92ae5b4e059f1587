//! The worst habits of `docs/style.md` do not come back into comments and names.

use std::fs;
use std::path::{Path, PathBuf};

/// Words that stand for a noun that should be there, and negations put last. In lower case.
const HABITS: [&str; 8] =
    ["nobody", "whoever", "somebody", "anybody", "so many", "as many as there", "is none", "has not,"];

/// Beginnings of names that have a usual one.
const NAMES: [&str; 2] = ["MOST_", "LEAST_"];

/// Collects the source files in a folder.
pub(super) fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" {
            sources(&path, found);
        } else if [".rs", ".wgsl", ".py"].iter().any(|ending| name.ends_with(ending)) {
            found.push(path);
        }
    }
}

/// The comment that a line is or ends with.
fn comment(line: &str) -> &str {
    ["// ", "//! ", "/// ", "# "].iter().find_map(|begin| line.split_once(begin)).map_or("", |(_, said)| said)
}

/// Whether a name in a line begins so.
fn begins_a_name(line: &str, beginning: &str) -> bool {
    let is_part = |before: char| before.is_alphanumeric() || before == '_';
    line.match_indices(beginning).any(|(at, _)| !line[..at].ends_with(is_part))
}

#[test]
fn comments_are_in_plain_english() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in ["src", "crates", "shaders", "tests", "examples", "python", "gst", "fuzz"] {
        sources(&root.join(folder), &mut files);
    }
    assert!(files.len() > 700, "{} files", files.len());
    let mut faults = Vec::new();
    for file in files.iter().filter(|file| !file.ends_with("tests/files/style.rs")) {
        for (number, line) in fs::read_to_string(file).unwrap().lines().enumerate() {
            let said = comment(line).to_lowercase();
            let habits = HABITS.iter().filter(|habit| said.contains(*habit));
            let names = NAMES.iter().filter(|name| begins_a_name(line, name));
            let place = format!("{}:{}", file.strip_prefix(root).unwrap().display(), number + 1);
            faults.extend(habits.chain(names).map(|fault| format!("{place}: {fault}")));
        }
    }
    assert!(faults.is_empty(), "docs/style.md says how to write these:\n{}", faults.join("\n"));
}

#[test]
fn comments_are_found_in_lines() {
    for (line, said) in [("let x = 1; // one", "one"), ("/// Fills.", "Fills."), ("x = 1  # one", "one"), ("a / b", "")]
    {
        assert_eq!(comment(line), said);
    }
    assert!(begins_a_name("a(MAX_PX)", "MAX_") && !begins_a_name("CLIMAX_PX", "MAX_"));
}

//! Resolves and compares paths.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Resolves all links in a path; components that do not exist are appended as they are.
pub fn resolve_links(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let existing = absolute.ancestors().find_map(|ancestor| Some((ancestor, ancestor.canonicalize().ok()?)));
    let Some((ancestor, there)) = existing else { return absolute };
    match absolute.strip_prefix(ancestor) {
        Ok(rest) if !rest.as_os_str().is_empty() => there.join(rest),
        _ => there,
    }
}

/// Returns whether one of two paths equals or contains the other, so that writing to one may damage the other. They
/// need not exist.
pub fn paths_overlap(one: &Path, other: &Path) -> bool {
    let [one, other] = [one, other].map(resolve_links);
    // Device and inode also detect a folder that is mounted in two places.
    let identity = |path: &Path| fs::metadata(path).ok().map(|there| (there.dev(), there.ino()));
    let contains = |outer: &Path, inner: &Path| {
        let outer_is = identity(outer);
        inner.starts_with(outer) || inner.ancestors().any(|part| outer_is.is_some() && identity(part) == outer_is)
    };
    contains(&one, &other) || contains(&other, &one)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn one_place_is_found_through_links_and_in_folders() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::create_dir_all(at("take/rgb")).unwrap();
        symlink(at("take"), at("link")).unwrap();
        symlink(at("take/rgb"), at("inner")).unwrap();
        symlink(dir.path(), at("take/up")).unwrap();
        for other in
            ["take", "take/", "./take", "link", "link/rgb", "inner", "inner/new/er", "take/none", "take/up/take"]
        {
            assert!(paths_overlap(&at("take"), &at(other)), "{other}");
            assert!(paths_overlap(&at(other), &at("take")), "{other}");
        }
        assert!(paths_overlap(&at("take"), dir.path()));
        for other in ["taken", "other", "take/up/other", "link/../taken"] {
            assert!(!paths_overlap(&at("take"), &at(other)), "{other}");
        }
        assert_eq!(resolve_links(&at("inner/new/er")), at("take/rgb").canonicalize().unwrap().join("new/er"));
    }
}

//! The tests that `docs/reliability.md` names in columns "tested by" exist, so that no promise loses its test unnoticed.

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use super::style::sources;

/// Returns the names of a file's tests.
fn tests(source: &str) -> impl Iterator<Item = &str> {
    source.split("#[test]\n").skip(1).filter_map(|rest| Some(rest.split_once("fn ")?.1.split_once('(')?.0))
}

/// Returns the rows of the tables whose last column is "tested by": the line's number, and the tests.
fn promises(page: &str) -> Vec<(usize, Vec<&str>)> {
    let (mut found, mut is_within) = (Vec::new(), false);
    for (number, line) in page.lines().enumerate() {
        let last = line.strip_suffix('|').and_then(|row| row.rsplit('|').next()).map(str::trim);
        match last {
            Some("tested by") => is_within = true,
            Some("---") => {}
            Some(tested_by) if is_within => {
                found.push((number + 1, tested_by.split('`').skip(1).step_by(2).collect()));
            }
            _ => is_within = false,
        }
    }
    found
}

#[test]
fn every_promise_names_tests_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    ["src", "crates", "tests"].iter().for_each(|folder| sources(&root.join(folder), &mut files));
    let texts: Vec<_> = files.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
    let known: HashSet<_> = texts.iter().flat_map(|text| tests(text)).collect();
    let page = fs::read_to_string(root.join("docs/reliability.md")).unwrap();
    let promises = promises(&page);
    assert!(promises.len() >= 30 && known.len() > 1000, "{} promises, {} tests", promises.len(), known.len());
    for (line, named) in promises {
        assert!(!named.is_empty(), "docs/reliability.md:{line}: no test");
        let missing: Vec<_> = named.iter().filter(|name| !known.contains(*name)).collect();
        assert!(missing.is_empty(), "docs/reliability.md:{line}: no test has the name {missing:?}");
    }
}

#[test]
fn promises_and_tests_are_found() {
    let page = "| a | tested by |\n|---|---|\n| b | `one`, `two` |\n| c | - |\n\n| d | e |\n|---|---|\n| f | `g` |\n";
    assert_eq!(promises(page), [(3, vec!["one", "two"]), (4, vec![])]);
    let source = "#[test]\n#[ignore = \"slow\"]\nfn one() {}\nfn other() {}\n";
    assert_eq!(tests(source).collect::<Vec<_>>(), ["one"]);
}

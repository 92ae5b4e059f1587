//! Parses INI files, as of ZED cameras: sections of `KEY=VALUE` lines; `;` and `#` begin comments.

use super::yaml::{Kind, Node};

/// Returns the name of a line `[SECTION]`.
fn section_name(line: &str) -> Option<&str> {
    let name = line.trim().strip_prefix('[')?.strip_suffix(']')?.trim();
    let is_name = name.starts_with(|first: char| first.is_ascii_alphabetic());
    (is_name && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')).then_some(name)
}

/// Returns the lines with content, and their numbers from 1.
fn significant_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (1..).zip(text.lines().map(str::trim));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with([';', '#']))
}

/// Returns whether the text begins with a section.
pub(super) fn is_ini(text: &str) -> bool {
    significant_lines(text).next().is_some_and(|(_, line)| section_name(line).is_some())
}

/// Parses `text` to a map of sections, which are maps of words. Fails with the line and the reason.
pub(super) fn parse(text: &str) -> Result<Node, (usize, String)> {
    let mut sections: Vec<(String, Node)> = Vec::new();
    for (line, content) in significant_lines(text) {
        if let Some(name) = section_name(content) {
            sections.push((name.to_owned(), Node { line, kind: Kind::Map(Vec::new()) }));
            continue;
        }
        let entry = content.split_once('=').map(|(key, value)| (key.trim(), value.trim()));
        match (entry, sections.last_mut().map(|(_, section)| &mut section.kind)) {
            (Some((key, value)), Some(Kind::Map(map))) if !key.is_empty() => {
                map.push((key.to_owned(), Node { line, kind: Kind::Scalar(value.to_owned()) }));
            }
            _ => return Err((line, "neither [SECTION] nor KEY=VALUE".into())),
        }
    }
    Ok(Node { line: 1, kind: Kind::Map(sections) })
}

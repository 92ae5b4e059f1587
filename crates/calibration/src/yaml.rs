//! Parses YAML and JSON, and OpenCV's FileStorage, whose YAML other parsers refuse.

use saphyr_parser::{Event, Parser, ScanError};

/// Maximum depth of nested lists and maps; calibrations need six.
const MAX_NESTING: usize = 32;

/// An entry and its line, from 1.
pub(super) struct Node {
    pub line: usize,
    pub kind: Kind,
}

pub(super) enum Kind {
    Scalar(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// Parses the first document of `text`; an empty map without any. Fails with the line and the reason.
pub(super) fn parse(text: &str) -> Result<Node, (usize, String)> {
    let repaired = repair_file_storage(text);
    let text = repaired.as_deref().unwrap_or(text);
    let fault = |error: ScanError| (error.marker().line(), error.info().replace('\n', " "));
    // Lists and maps that are still open, the innermost last.
    let mut open: Vec<Node> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(fault)?;
        let line = span.start.line();
        let done = match event {
            Event::Scalar(text, ..) => Node { line, kind: Kind::Scalar(text.into_owned()) },
            Event::SequenceStart(..) | Event::MappingStart(..) if open.len() == MAX_NESTING => {
                return Err((line, "nested too deep".into()));
            }
            Event::SequenceStart(..) => {
                open.push(Node { line, kind: Kind::List(Vec::new()) });
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Node { line, kind: Kind::Map(Vec::new()) });
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(node) => node,
                None => continue,
            },
            Event::Alias(_) => return Err((line, "aliases are not supported; write the value out".into())),
            Event::DocumentEnd => break,
            _ => continue,
        };
        match open.last_mut().map(|node| &mut node.kind) {
            None => return Ok(done),
            Some(Kind::List(list)) => list.push(done),
            Some(Kind::Map(map)) => match map.last_mut() {
                // A key that still lacks its value has a placeholder at line 0, which no parsed entry has.
                Some((_, value)) if value.line == 0 => *value = done,
                _ => match done.kind {
                    Kind::Scalar(key) => map.push((key, Node { line: 0, kind: Kind::List(Vec::new()) })),
                    _ => return Err((line, "a key must be a word".into())),
                },
            },
            Some(Kind::Scalar(_)) => {}
        }
    }
    Ok(Node { line: 1, kind: Kind::Map(Vec::new()) })
}

/// Returns a file of OpenCV as YAML, line by line: its first line `%YAML:1.0` is no directive of YAML and becomes a
/// comment, and a key may be followed by its value without a space (`data:[`, `rows:3`). `None` for other files.
fn repair_file_storage(text: &str) -> Option<String> {
    if !text.starts_with('%') && !text.contains("!!opencv-matrix") {
        return None;
    }
    let mut repaired = String::with_capacity(text.len() + 64);
    for line in text.split_inclusive('\n') {
        let indent = line.len() - line.trim_start().len();
        let is_key = |key: &str| {
            !key.is_empty() && key.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"_-.".contains(&byte))
        };
        match line[indent..].split_once(':') {
            _ if line.starts_with('%') => repaired.extend(["#", line]),
            Some((key, value)) if is_key(key) && !value.starts_with(char::is_whitespace) => {
                repaired.extend([&line[..indent], key, ": ", value]);
            }
            _ => repaired.push_str(line),
        }
    }
    Some(repaired)
}

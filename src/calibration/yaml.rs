//! Parses the YAML of calibrations, with the line of every entry for error messages.

use std::path::{Path, PathBuf};

use saphyr_parser::{Event, Parser, ScanError};

use super::error::{CalibrationError, Fault};
use crate::files::input;

/// Maximum depth of nested lists and maps; calibrations need three.
const MAX_NESTING: usize = 32;

/// A parsed file.
pub(super) struct File {
    path: PathBuf,
    root: Node,
}

/// An entry and its line, from 1.
struct Node {
    line: usize,
    kind: Kind,
}

enum Kind {
    Scalar(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// A matrix of any size, row by row.
pub(super) struct Matrix {
    pub rows: usize,
    pub cols: usize,
    pub data: Vec<f64>,
}

impl File {
    /// Reads and parses the file `path`.
    pub fn open(path: &Path) -> Result<Self, CalibrationError> {
        let fail = |source| CalibrationError::Io { path: path.to_owned(), source };
        let bytes = input::read(path, input::MAX_CALIBRATION_BYTES).map_err(fail)?;
        Self::parse(path, &String::from_utf8_lossy(&bytes))
    }

    /// Parses `text`, the content of `path`.
    pub fn parse(path: &Path, text: &str) -> Result<Self, CalibrationError> {
        // OpenCV's first line `%YAML:1.0` is not a valid YAML directive, so it is turned into a comment.
        let commented = text.trim_start_matches('\u{feff}').strip_prefix('%').map(|rest| format!("#{rest}"));
        let text = commented.as_deref().unwrap_or(text);
        let root = parse_tree(text).map_err(|(line, what)| CalibrationError::File {
            path: path.to_owned(),
            line,
            fault: Fault::Yaml(what),
        })?;
        Ok(Self { path: path.to_owned(), root })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn root(&self) -> Value<'_> {
        Value { path: &self.path, key: "the file", line: 0, kind: &self.root.kind }
    }
}

/// Parses the first document of `text`; an empty map without any. Fails with the line and the reason.
fn parse_tree(text: &str) -> Result<Node, (usize, String)> {
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

/// An entry of a file, with its key.
#[derive(Clone, Copy)]
pub(super) struct Value<'a> {
    path: &'a Path,
    key: &'a str,
    line: usize,
    kind: &'a Kind,
}

impl<'a> Value<'a> {
    /// Returns the error for `fault` in this file and line.
    pub fn to_error(self, fault: Fault) -> CalibrationError {
        CalibrationError::File { path: self.path.to_owned(), line: self.line, fault }
    }

    /// Returns the key, for messages.
    pub fn key(&self) -> String {
        self.key.to_owned()
    }

    /// Returns the entry whose key satisfies `matches_key`.
    pub fn find(&self, matches_key: impl Fn(&str) -> bool) -> Option<Value<'a>> {
        let Kind::Map(map) = self.kind else { return None };
        let (key, node) = map.iter().find(|(key, _)| matches_key(key))?;
        Some(Value { path: self.path, key, line: node.line, kind: &node.kind })
    }

    /// Returns the entry `key`, if it exists.
    pub fn get(&self, key: &str) -> Option<Value<'a>> {
        self.find(|name| name == key)
    }

    /// Returns the entry `key`; `hint` is the remedy if it is missing.
    pub fn require(&self, key: &str, hint: &'static str) -> Result<Value<'a>, CalibrationError> {
        self.get(key).ok_or_else(|| self.to_error(Fault::Missing { key: key.into(), hint }))
    }

    fn type_error(&self, expected: &'static str) -> CalibrationError {
        self.to_error(Fault::Kind { key: self.key(), expected })
    }

    pub fn text(&self) -> Result<&'a str, CalibrationError> {
        match self.kind {
            Kind::Scalar(text) => Ok(text),
            _ => Err(self.type_error("one word")),
        }
    }

    fn parse_number(&self) -> Result<f64, CalibrationError> {
        let Kind::Scalar(text) = self.kind else { return Err(self.type_error("a list of numbers")) };
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| {
            let short = text.chars().take(20).collect();
            self.to_error(Fault::NotFinite { key: self.key(), text: short })
        })
    }

    /// Returns an integer >= 0.
    pub fn parse_count(&self) -> Result<u32, CalibrationError> {
        self.text()?.trim_end_matches(".0").parse().map_err(|_| self.type_error("a whole number"))
    }

    fn items(&self) -> Option<impl Iterator<Item = Value<'a>>> {
        let Value { path, key, .. } = *self;
        let Kind::List(list) = self.kind else { return None };
        Some(list.iter().map(move |node| Value { path, key, line: node.line, kind: &node.kind }))
    }

    /// Returns a matrix from `rows`, `cols` and `data`; from a list of rows; or from a list of numbers, as one column.
    pub fn parse_matrix(&self) -> Result<Matrix, CalibrationError> {
        if let Kind::Map(_) = self.kind {
            let side = |key| self.require(key, "a matrix has rows, cols and data")?.parse_count();
            let (rows, cols) = (side("rows")? as usize, side("cols")? as usize);
            let data = self.require("data", "a matrix has rows, cols and data")?;
            // Keeps the matrix's own key for messages.
            let data = Value { key: self.key, ..data }.parse_matrix()?.data;
            if rows.checked_mul(cols) != Some(data.len()) {
                return Err(self.to_error(Fault::Data { key: self.key(), said: (rows, cols), found: data.len() }));
            }
            return Ok(Matrix { rows, cols, data });
        }
        let mut matrix = Matrix { rows: 0, cols: 1, data: Vec::new() };
        for item in self.items().ok_or_else(|| self.type_error("a matrix or a list of numbers"))? {
            let before = matrix.data.len();
            match item.items() {
                Some(row) => {
                    for number in row {
                        matrix.data.push(number.parse_number()?);
                    }
                }
                None => matrix.data.push(item.parse_number()?),
            }
            let cols = matrix.data.len() - before;
            if matrix.rows > 0 && cols != matrix.cols {
                return Err(self.type_error("a matrix with rows of one length"));
            }
            (matrix.rows, matrix.cols) = (matrix.rows + 1, cols);
        }
        Ok(matrix)
    }

    /// Returns exactly `N` numbers of a matrix with `rows` rows.
    pub fn parse_numbers<const N: usize>(
        &self,
        rows: usize,
        expected: &'static str,
    ) -> Result<[f64; N], CalibrationError> {
        let Matrix { rows: found, cols, data } = self.parse_matrix()?;
        let wrong = || self.to_error(Fault::Dimensions { key: self.key(), found: (found, cols), expected });
        // Accepts row and column vectors.
        let fits = found == rows || (rows == N && found == 1);
        data.try_into().ok().filter(|_| fits).ok_or_else(wrong)
    }
}

//! The entries of a calibration file, whatever its syntax (YAML, JSON or INI), with the line of each for error messages.

use std::path::{Path, PathBuf};

use super::yaml::{Kind, Node};
use super::{ini, yaml};
use bokehcam::calibration::{CalibrationError, Fault};
use bokehcam_files::input;

/// A parsed file.
pub(super) struct File {
    path: PathBuf,
    root: Node,
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
        let fail = |error| CalibrationError::Io { path: path.to_owned(), why: input::format_io_error(&error) };
        let bytes = input::read(path, input::MAX_CALIBRATION_BYTES).map_err(fail)?;
        Self::parse(path, &String::from_utf8_lossy(&bytes))
    }

    /// Parses `text`, the content of `path`, whose beginning shows its syntax.
    pub fn parse(path: &Path, text: &str) -> Result<Self, CalibrationError> {
        let text = text.trim_start_matches('\u{feff}');
        if text.trim_start().starts_with('<') {
            return Err(CalibrationError::Unconverted { path: path.to_owned(), format: "XML" });
        }
        let (format, root) = match text {
            ini if ini::is_ini(ini) => ("INI", ini::parse(ini)),
            // JSON is YAML, too.
            yaml => ("YAML", yaml::parse(yaml)),
        };
        match root {
            Ok(root) => Ok(Self { path: path.to_owned(), root }),
            Err((line, what)) => {
                let fault = Fault::Syntax { format, what };
                Err(CalibrationError::File { path: path.to_owned(), line, fault })
            }
        }
    }

    pub fn root(&self) -> Value<'_> {
        Value { path: &self.path, key: "the file", line: 0, kind: &self.root.kind }
    }
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

    /// Returns a finite number.
    pub fn number(&self) -> Result<f64, CalibrationError> {
        self.text()?;
        self.parse_number()
    }

    /// Returns the elements of a list.
    pub fn items(&self) -> Option<impl Iterator<Item = Value<'a>>> {
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

    /// Returns exactly `N` numbers of a matrix with `rows` rows, which may be written as one list, row by row.
    pub fn parse_numbers<const N: usize>(
        &self,
        rows: usize,
        expected: &'static str,
    ) -> Result<[f64; N], CalibrationError> {
        let Matrix { rows: found, cols, data } = self.parse_matrix()?;
        let wrong = || self.to_error(Fault::Dimensions { key: self.key(), found: (found, cols), expected });
        // A vector may be a row, and a matrix a list.
        let fits = found == rows || (rows == N && found == 1) || (found == N && cols == 1);
        data.try_into().ok().filter(|_| fits).ok_or_else(wrong)
    }
}

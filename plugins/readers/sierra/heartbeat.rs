//! Heartbeat output: Sierra's text files, in every format and with every option.
//!
//! The formats are those of the IOSS library of SEACAS (`Iohb_DatabaseIO`, `Iohb_Layout`): ORIGINAL (labelled rows),
//! CSV, TEXT, their time-stamped variants and SPYHIS. No file states its format, and separator, labels, legend and
//! stamp can be changed one by one, so that the reader infers the format from the lines.

mod line;
mod parser;

use std::path::{Path, PathBuf};

use lacuna::plugin::reader::ReadError;

use self::parser::Parser;
use crate::readers::listed;

/// A heartbeat file: named columns over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Heartbeat {
    /// Path of the file.
    pub path: PathBuf,
    /// Names of the columns; vectors and tensors are flattened with `_x`, `_xx`, ... as suffix.
    pub names: Vec<String>,
    /// Values, one list per column.
    pub columns: Vec<Vec<f64>>,
    /// Index of the time column, if there is one.
    pub time: Option<usize>,
    /// Layout in words.
    pub layout: String,
    /// Repairs that were made: a truncated last line, steps repeated by a restart.
    pub notes: Vec<String>,
}

impl Heartbeat {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let bytes = std::fs::read(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        Self::parse(path, &bytes)
    }

    /// Parses the bytes of a file; `path` is only used in messages.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, ReadError> {
        if bytes.is_empty() {
            return Err(ReadError::new(path, "is empty"));
        }
        if bytes.contains(&0) {
            return Err(ReadError::new(path, "is not a text file: it contains zero bytes"));
        }
        let text = String::from_utf8_lossy(bytes);
        let mut parser = Parser::new(path);
        parser.parse(&text)?;
        parser.finish()
    }

    /// Returns times and values of a column, found by its exact name or the only one that differs in case.
    pub fn series(&self, name: &str) -> Result<(Vec<f64>, Vec<f64>), ReadError> {
        let complain = |text: String| ReadError::new(&self.path, text);
        let with = |alike: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..self.names.len()).filter(|&i| alike(&self.names[i])).collect()
        };
        let mut found = with(&|n| n == name);
        if found.is_empty() {
            found = with(&|n| n.eq_ignore_ascii_case(name));
        }
        let column = match found[..] {
            [column] => column,
            [] => {
                let known = listed(&self.names);
                return Err(complain(format!("has no column `{name}`; it has {known}")));
            }
            _ => return Err(complain(format!("has {} columns `{name}`", found.len()))),
        };
        let time = self.time.ok_or_else(|| {
            complain(format!("has no time column; it has {}", listed(&self.names)))
                .help("print `global time` in the heartbeat block, or choose `format = csv`")
        })?;
        Ok((self.columns[time].clone(), self.columns[column].clone()))
    }
}

/// Returns true if a line begins with a time stamp in brackets, as the library's own.
fn stamped(line: &str) -> bool {
    line.strip_prefix('+').is_some_and(|stamp| stamp.starts_with(['[', '{', '(', '<']))
}

/// Returns true if the beginning of a file shows heartbeat output: Sierra's own first line, labels, a padded legend
/// that begins with the time, or one of other names above numbers in the same columns.
pub fn recognised(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let Some(line) = lines.next() else { return false };
    let first = line.split([',', '\t', ';', '|']).next().unwrap_or_default();
    let labelled = first
        .split_once('=')
        .is_some_and(|(name, value)| !name.trim().is_empty() && line::number(value).is_some());
    let padded = first.len() > first.trim().len() && first.trim().eq_ignore_ascii_case("time");
    line.starts_with("% Sierra")
        || labelled
        || padded
        || stamped(line)
        || lines.next().is_some_and(|row| line::legend_above(line, row))
}

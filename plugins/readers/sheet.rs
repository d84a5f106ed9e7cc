//! A CSV file as a sheet: headings with units, and records with their line numbers.

use std::path::{Path, PathBuf};

use csv::StringRecord;
use lacuna::data::Unit;
use lacuna::plugin::reader::ReadError;

use super::faults::Faults;
use super::rows::Rows;
use super::{ending, listed};

/// Heading of a column, such as `time [s]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Heading {
    /// Complete heading with unit.
    pub text: String,
    /// Name, without the unit.
    pub name: String,
    /// Unit in brackets.
    pub unit: Option<Unit>,
}

/// A row below the headings.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Record {
    /// Line in the file, counted from 1.
    pub line: usize,
    /// Cells, without surrounding blanks.
    pub cells: StringRecord,
}

/// The last line of a file, which has no line end.
pub(super) struct Ending<'a> {
    /// Line in the file, counted from 1.
    pub line: usize,
    /// The last field of the line.
    pub field: &'a str,
    /// True if a quote of the file is not closed.
    pub is_quote_open: bool,
}

/// A CSV file in memory. Without its records it describes the columns of a file that is read row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Path of the file.
    pub path: PathBuf,
    /// Headings of the columns.
    pub headings: Vec<Heading>,
    /// Line of the headings, counted from 1.
    pub heading_line: usize,
    /// Rows below the headings.
    pub records: Vec<Record>,
}

impl Sheet {
    /// Reads a file. Fields are separated by commas, or by semicolons or tabs if the first line has no comma; lines
    /// that start with `#` are comments.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let bytes = std::fs::read(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        Self::parse(path, &bytes)
    }

    /// Parses the bytes of a file; `path` is only used in messages.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, ReadError> {
        let (sheet, faults) = Self::scan(path, bytes)?;
        faults.or(sheet)
    }

    /// Opens a file and scans it like [`Sheet::scan`].
    pub fn open(path: &Path) -> Result<(Self, Faults), ReadError> {
        let bytes = std::fs::read(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        Self::scan(path, &bytes)
    }

    /// Parses the lines that can be read, and collects the errors of the others, for callers that go on to check the
    /// cells. The sheet is complete only if there are no errors.
    pub fn scan(path: &Path, bytes: &[u8]) -> Result<(Self, Faults), ReadError> {
        let (mut sheet, mut rows, mut faults) = Rows::of(path, bytes, delimiter(bytes))?;
        let mut record = Record::default();
        while rows.next(&mut record, &mut faults) {
            sheet.records.push(record.clone());
        }
        if let Some((line, error)) = sheet.end(bytes) {
            faults.note(line, error);
        }
        Ok((sheet, faults))
    }

    /// Returns the error of a last line of a file in memory that seems to be cut off.
    fn end(&self, bytes: &[u8]) -> Option<(usize, ReadError)> {
        if bytes.ends_with(b"\n") || bytes.ends_with(b"\r") {
            return None;
        }
        if is_comment(bytes.rsplit(|&b| b == b'\n').next().unwrap_or_default()) {
            return None;
        }
        let (last, above) = self.records.split_last()?;
        // A file is read once, so that a crate for counting bytes is not worthwhile.
        #[allow(clippy::naive_bytecount)]
        let quotes = bytes.iter().filter(|&&b| b == b'"').count();
        let column = self.headings.len() - 1;
        let field = &last.cells[column];
        let ending = Ending { line: last.line, field, is_quote_open: quotes % 2 == 1 };
        self.cut(&ending, above.iter().map(|record| &record.cells[column]))
    }

    /// Returns the error of a last line without a line end that seems to be cut off, given the last fields of the lines
    /// above it; see [`ending`].
    pub(super) fn cut<'a>(
        &self,
        last: &Ending<'_>,
        above: impl Iterator<Item = &'a str>,
    ) -> Option<(usize, ReadError)> {
        let reason = if last.is_quote_open {
            "a quote is not closed".to_owned()
        } else {
            ending::cut(last.field, above)?
        };
        let text =
            format!("the file seems to be cut off: its last line has no line end, and {reason}");
        let error = self
            .complain_at(last.line, self.headings.len() - 1, text)
            .help("write the file again; if it is whole, end its last line with a line break");
        Some((last.line, error))
    }

    /// Returns the index of a column; `None` if there is none of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        let exact = self.headings.iter().position(|h| h.text == name);
        exact.or_else(|| self.headings.iter().position(|h| h.name == name))
    }

    /// Returns the index of a required column; fails if there is none of this name.
    pub fn column(&self, name: &str) -> Result<usize, ReadError> {
        self.find(name).ok_or_else(|| {
            let names: Vec<&str> = self.headings.iter().map(|h| h.name.as_str()).collect();
            let text = format!("has no column `{name}`; it has {}", listed(&names));
            ReadError::new(&self.path, text)
        })
    }

    /// Builds an error about a cell.
    pub fn complain(
        &self,
        record: &Record,
        column: usize,
        message: impl Into<String>,
    ) -> ReadError {
        self.complain_at(record.line, column, message)
    }

    fn complain_at(&self, line: usize, column: usize, message: impl Into<String>) -> ReadError {
        let name = &self.headings[column].name;
        let place = format!("line {line}, column {} (`{name}`)", column + 1);
        ReadError::new(&self.path, message).at(place)
    }

    /// Returns a cell as a number; `None` if it is blank, `NaN` or `NA`.
    pub fn number(&self, record: &Record, column: usize) -> Result<Option<f64>, ReadError> {
        let cell = &record.cells[column];
        if ["", "nan", "na"].iter().any(|missing| cell.eq_ignore_ascii_case(missing)) {
            return Ok(None);
        }
        cell.parse().map(Some).map_err(|_| {
            let error = self.complain(record, column, format!("expected a number, found `{cell}`"));
            let point = cell.replacen(',', ".", 1);
            match point.parse::<f64>() {
                Ok(_) => error.help(format!("write the decimals after a point: `{point}`")),
                Err(_) => error,
            }
        })
    }

    /// Returns the conversion of a column to a unit, from the unit of its heading if it has one.
    pub fn conversion(&self, column: usize, to: &Unit) -> Result<Conversion, ReadError> {
        let heading = &self.headings[column];
        let conversion = Conversion { from: heading.unit.clone(), to: to.clone() };
        if conversion.apply(1.0).is_none() {
            let from = heading.unit.as_ref().map_or(String::new(), ToString::to_string);
            let text = format!(
                "expected a unit that converts to `{to}`, found `{}` in `{from}`",
                heading.name
            );
            let place = format!("line {}, column {}", self.heading_line, column + 1);
            return Err(ReadError::new(&self.path, text).at(place));
        }
        Ok(conversion)
    }
}

/// A unit conversion; the identity if the source states no unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Conversion {
    from: Option<Unit>,
    to: Unit,
}

impl Conversion {
    /// Returns the identity: the numbers are in this unit already.
    pub fn none(to: &Unit) -> Self {
        Self { from: None, to: to.clone() }
    }

    /// Returns the number in the new unit; `None` if the units are incompatible.
    pub fn apply(&self, x: f64) -> Option<f64> {
        self.from.as_ref().map_or(Some(x), |from| from.convert(x, &self.to))
    }

    /// Converts a difference, such as a standard deviation: offsets between the units, as of temperatures, do not
    /// apply.
    pub fn width(&self, x: f64) -> Option<f64> {
        Some(self.apply(x)? - self.apply(0.0)?)
    }

    /// Returns true if the source states its unit.
    pub fn is_stated(&self) -> bool {
        self.from.is_some()
    }
}

/// Returns true for a line that is a comment.
pub(super) fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#")
}

/// Determines the field separator of a table from its first line.
pub(super) fn delimiter(bytes: &[u8]) -> u8 {
    let first = bytes.split(|&b| b == b'\n').find(|line| !is_comment(line));
    let first = first.unwrap_or_default();
    let has = |c: u8| first.contains(&c);
    match (has(b','), has(b';'), has(b'\t')) {
        (false, true, _) => b';',
        (false, false, true) => b'\t',
        _ => b',',
    }
}

/// Reads a heading; fails if it ends in a unit that is none.
pub(super) fn heading(text: &str) -> Result<Heading, String> {
    let whole = |name: &str, unit| Heading { text: text.to_owned(), name: name.to_owned(), unit };
    let Some((name, unit)) = text.strip_suffix(']').and_then(|text| text.rsplit_once('[')) else {
        return Ok(whole(text, None));
    };
    match Unit::parse(unit) {
        Ok(unit) => Ok(whole(name.trim(), Some(unit))),
        // A parameter of one scenario, such as `height[ball 1]`.
        Err(_) if !name.ends_with(' ') => Ok(whole(text, None)),
        Err(error) => Err(error.to_string()),
    }
}

//! Parser of a heartbeat file, line by line.

use std::path::Path;

use lacuna::plugin::reader::ReadError;

use super::Heartbeat;
use super::line::{self, Line, Separator};
use crate::readers::listed;
use crate::readers::sierra::signal::COMPONENTS;

/// State of the parser: what the lines so far have shown of the file.
pub(super) struct Parser<'a> {
    path: &'a Path,
    separator: Option<Separator>,
    header: Option<Header>,
    names: Vec<String>,
    labels: Vec<(String, usize)>,
    time: Option<usize>,
    rows: Vec<Vec<f64>>,
    comments: bool,
    stamped: bool,
    restarts: usize,
    replaced: usize,
    notes: Vec<String>,
}

struct Header {
    text: String,
    line: usize,
}

type Labels = Vec<(String, Vec<f64>)>;

impl<'a> Parser<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self {
            path,
            separator: None,
            header: None,
            names: Vec::new(),
            labels: Vec::new(),
            time: None,
            rows: Vec::new(),
            comments: false,
            stamped: false,
            restarts: 0,
            replaced: 0,
            notes: Vec::new(),
        }
    }

    pub(super) fn parse(&mut self, text: &str) -> Result<(), ReadError> {
        let lines: Vec<(usize, &str)> = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line))
            .filter(|(_, line)| !line.trim().is_empty())
            .collect();
        let whole = text[text.trim_end().len()..].contains('\n');
        for (i, &(number, line)) in lines.iter().enumerate() {
            let previous = i.checked_sub(1).map(|i| lines[i].1);
            let next = lines.get(i + 1).map(|&(_, next)| next);
            if next.is_none() && !whole && !previous.is_some_and(|p| as_long(line, p)) {
                self.notes.push(format!("line {number} has no line end and was left out"));
            } else if !self.take(number, line)? {
                self.excuse(number, line, next)?;
            }
        }
        Ok(())
    }

    /// Parses a line; returns false if it does not fit here.
    fn take(&mut self, number: usize, line: &str) -> Result<bool, ReadError> {
        let separator = self.separator.clone().or_else(|| line::sniff(line));
        let parsed = line::parse(line, separator.as_ref(), self.known_columns());
        if !matches!(parsed, Line::Message | Line::Broken) {
            self.separator = separator;
            self.stamped |= line.starts_with('+');
        }
        match parsed {
            Line::Message => {
                self.comments |= line.trim_start().starts_with('%');
                Ok(true)
            }
            Line::Names(names) => self.legend(number, line, names),
            Line::Labelled(labels) => self.labelled(number, line, labels),
            Line::Numbers(numbers) => self.row(number, numbers),
            Line::Broken => Ok(false),
        }
    }

    fn known_columns(&self) -> Option<usize> {
        (!self.names.is_empty()).then_some(self.names.len())
    }

    fn legend(&mut self, line: usize, text: &str, names: Vec<String>) -> Result<bool, ReadError> {
        let Some(header) = &self.header else {
            if !self.rows.is_empty() {
                return Ok(false);
            }
            let start = names.first().and_then(|first| text.find(first.as_str())).unwrap_or(0);
            self.header = Some(Header { text: text[start..].trim_end().to_owned(), line });
            self.set_names(names);
            return Ok(true);
        };
        if names.ends_with(&self.names) {
            self.restarts += usize::from(!self.rows.is_empty());
            return Ok(true);
        }
        // CTH writes units or long names in a second header line.
        if self.rows.is_empty() && line == header.line + 1 && names.len() == self.names.len() {
            return Ok(true);
        }
        let (new, old) = (listed(&names), listed(&self.names));
        let text = format!("the header changes to {new}; the columns were {old}");
        Err(ReadError::new(self.path, text).at(format!("line {line}")))
    }

    fn set_names(&mut self, names: Vec<String>) {
        self.time = names.iter().position(|name| name.eq_ignore_ascii_case("time"));
        self.names = names;
    }

    fn labelled(&mut self, number: usize, line: &str, labels: Labels) -> Result<bool, ReadError> {
        if self.labels.is_empty() {
            // Labels name the columns: they cannot begin below rows without labels.
            if !self.rows.is_empty() {
                return Ok(false);
            }
            let shape: Vec<(String, usize)> =
                labels.iter().map(|(name, values)| (name.clone(), values.len())).collect();
            let flat = flattened(&shape);
            // A legend has the true names of the components; from labels they can only be guessed.
            if self.header.is_none() || self.names.len() != flat.len() {
                self.set_names(flat);
            }
            self.labels = shape;
        }
        if self.fits(&labels) {
            return self.row(number, labels.into_iter().flat_map(|(_, values)| values).collect());
        }
        // After a row cut by a kill, a restart continues in the same line.
        let first = format!("{}=", self.labels[0].0);
        let tails = line.match_indices(&first).map(|(start, _)| &line[start..]);
        let whole =
            tails.map(|tail| line::parse(tail, self.separator.as_ref(), None)).find_map(|parsed| {
                match parsed {
                    Line::Labelled(labels) if self.fits(&labels) => Some(labels),
                    _ => None,
                }
            });
        let Some(labels) = whole else { return Ok(false) };
        self.notes.push(format!("line {number}: an unfinished row was left out"));
        self.row(number, labels.into_iter().flat_map(|(_, values)| values).collect())
    }

    fn fits(&self, labels: &Labels) -> bool {
        labels.iter().map(|(n, v)| (n, v.len())).eq(self.labels.iter().map(|(n, k)| (n, *k)))
    }

    fn row(&mut self, number: usize, mut row: Vec<f64>) -> Result<bool, ReadError> {
        if self.names.is_empty() {
            self.set_names((1..=row.len()).map(|i| format!("column_{i}")).collect());
        }
        if self.rows.is_empty() && self.stamped && self.separator == Some(Separator::Blank) {
            // With blanks as the separator, the words and numbers of the time stamp look like columns.
            let columns = row.len().min(self.names.len());
            row.drain(..row.len() - columns);
            let names = self.names.split_off(self.names.len() - columns);
            self.set_names(names);
        }
        if row.len() != self.names.len() {
            return Ok(false);
        }
        if let Some(time) = self.time {
            if !row[time].is_finite() {
                let text = format!("the time is {}", row[time]);
                return Err(ReadError::new(self.path, text).at(format!("line {number}")));
            }
            // A restart repeats steps, and rounding can give two steps the same time: the later row replaces all
            // earlier ones that are not before it.
            while self.rows.last().is_some_and(|last| last[time] >= row[time]) {
                self.rows.pop();
                self.replaced += 1;
            }
        }
        self.rows.push(row);
        Ok(true)
    }

    /// Accepts a line that does not fit if it is a row cut by the end of the run: at the end of the file, before the
    /// header of a restart, or followed by that header in the same line. Otherwise fails.
    fn excuse(&mut self, number: usize, line: &str, next: Option<&str>) -> Result<(), ReadError> {
        let glued = line.contains("% Sierra")
            || self.header.as_ref().is_some_and(|header| line.ends_with(&header.text));
        let before_header = next.is_some_and(|next| {
            let parsed = line::parse(next, self.separator.as_ref(), self.known_columns());
            matches!(parsed, Line::Names(_) | Line::Message)
        });
        if !self.rows.is_empty() && (next.is_none() || glued || before_header) {
            self.restarts += usize::from(glued);
            self.notes.push(format!("line {number}: an unfinished row was left out"));
            return Ok(());
        }
        let found: String = line.trim().chars().take(60).collect();
        let expected = match self.known_columns() {
            Some(columns) => format!("a row of {columns} numbers"),
            None => "a header or a row of numbers".to_owned(),
        };
        let text = format!("expected {expected}, found `{found}`");
        Err(ReadError::new(self.path, text).at(format!("line {number}")))
    }

    pub(super) fn finish(mut self) -> Result<Heartbeat, ReadError> {
        if self.rows.is_empty() {
            return Err(ReadError::new(self.path, "has no complete row of numbers"));
        }
        if self.restarts > 0 {
            self.notes.push(format!("the header is repeated {} times", self.restarts));
        }
        if self.replaced > 0 {
            self.notes.push(format!("{} repeated steps: the last values are used", self.replaced));
        }
        let columns =
            (0..self.names.len()).map(|c| self.rows.iter().map(|row| row[c]).collect()).collect();
        let layout = self.layout();
        Ok(Heartbeat {
            path: self.path.to_owned(),
            names: self.names,
            columns,
            time: self.time,
            layout,
            notes: self.notes,
        })
    }

    fn layout(&self) -> String {
        let separator = match &self.separator {
            Some(Separator::Text(text)) if text == "\t" => "tab".to_owned(),
            Some(Separator::Text(text)) => format!("`{text}`"),
            Some(Separator::Blank) => "blank".to_owned(),
            None => "no".to_owned(),
        };
        let rows = match (self.comments, self.labels.is_empty(), self.header.is_some()) {
            (true, _, _) => "SPYHIS",
            (false, false, false) => "labels",
            (false, false, true) => "labels and legend",
            (false, true, true) => "legend",
            (false, true, false) => "neither labels nor legend",
        };
        format!("{rows}, {separator} separator")
    }
}

/// Returns true if a last line without a line end is complete. Fixed formats print all numbers with equal length, so
/// that its last number is complete if it is as long as the one above it.
fn as_long(line: &str, above: &str) -> bool {
    let last = |text: &str| {
        let digit = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '+' | '-');
        let number = text.rsplit(|c| !digit(c)).next().unwrap_or_default();
        (line::number(number).is_some()).then(|| number.trim_start_matches('-').len())
    };
    last(line).is_some_and(|length| last(above) == Some(length))
}

/// Returns the column names of labelled rows, whose vectors and tensors have one label for all components.
fn flattened(labels: &[(String, usize)]) -> Vec<String> {
    let mut names = Vec::new();
    for (label, count) in labels {
        match count {
            1 => names.push(label.clone()),
            3 => names.extend(["x", "y", "z"].map(|c| format!("{label}_{c}"))),
            6 => names.extend(COMPONENTS.map(|c| format!("{label}_{c}"))),
            n => names.extend((1..=*n).map(|i| format!("{label}_{i}"))),
        }
    }
    names
}

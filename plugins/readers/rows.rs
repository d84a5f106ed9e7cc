//! The rows of a CSV file, one after the other: a long table is never in memory as text.

use std::collections::{HashSet, VecDeque};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use csv::{ErrorKind, Reader, ReaderBuilder, StringRecord, Trim};
use lacuna::plugin::reader::ReadError;

use super::faults::Faults;
use super::sheet::{Ending, Heading, Record, Sheet, delimiter, heading, is_comment};

/// Rows below the headings.
pub struct Rows<R> {
    reader: Reader<R>,
    path: PathBuf,
    comma: bool,
}

impl<R: Read> Rows<R> {
    /// Reads the headings. The sheet has no records, and the faults are those of the headings.
    pub fn of(path: &Path, source: R, delimiter: u8) -> Result<(Sheet, Self, Faults), ReadError> {
        let mut reader = ReaderBuilder::new()
            .delimiter(delimiter)
            .comment(Some(b'#'))
            .trim(Trim::All)
            .from_reader(source);
        let comma = delimiter == b',';
        let names = reader.headers().map_err(|error| unequal(path, comma, &error).1)?.clone();
        if names.iter().all(str::is_empty) {
            return Err(ReadError::new(path, "is empty: expected a line of column names"));
        }
        let heading_line = names.position().map_or(1, |p| p.line() as usize);
        let mut headings: Vec<Heading> = Vec::with_capacity(names.len());
        let mut texts = HashSet::new();
        let mut faults = Faults::default();
        for (column, text) in names.iter().enumerate() {
            let wrong = |message: String| {
                ReadError::new(path, message)
                    .at(format!("line {heading_line}, column {}", column + 1))
            };
            let heading = heading(text).map_err(&wrong)?;
            if !texts.insert(heading.text.clone()) {
                let text = format!("two columns are called `{}`", heading.name);
                faults.note(heading_line, wrong(text));
            }
            headings.push(heading);
        }
        let sheet = Sheet { path: path.to_owned(), headings, heading_line, records: Vec::new() };
        Ok((sheet, Self { reader, path: path.to_owned(), comma }, faults))
    }

    /// Line in which the row begins that was read last. Its position is that of comments above it, if there are any.
    fn line_of(&self, cells: &StringRecord) -> usize {
        let begin = cells.position().map_or(0, |p| p.line() as usize);
        let end = self.reader.position().line() as usize;
        if end <= begin + 1 {
            return begin;
        }
        let inside: usize = cells.iter().map(|cell| cell.matches('\n').count()).sum();
        begin.max(end.saturating_sub(1 + inside))
    }

    /// Reads the next row that can be read, and adds the errors of those before it; false at the end of the file.
    pub fn next(&mut self, record: &mut Record, faults: &mut Faults) -> bool {
        loop {
            match self.reader.read_record(&mut record.cells) {
                Ok(false) => return false,
                Ok(true) => {
                    record.line = self.line_of(&record.cells);
                    return true;
                }
                Err(error) => {
                    let (line, error) = unequal(&self.path, self.comma, &error);
                    faults.note(line, error);
                }
            }
        }
    }
}

/// Largest number of rows before the last to which the last field of a file without a final line end is compared.
const COMPARED: usize = 1_000_000;

impl Rows<BufReader<File>> {
    /// Opens a file and reads its headings. The faults are those of the headings and of a last line that seems to be cut off.
    pub fn open(path: &Path) -> Result<(Sheet, Self, Faults), ReadError> {
        let failed = |e: std::io::Error| ReadError::new(path, format!("cannot be opened: {e}"));
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let delimiter = first_delimiter(&mut file).map_err(failed)?;
        let ends = ends_with_line(&mut file).map_err(failed)?;
        file.rewind().map_err(failed)?;
        let (sheet, rows, mut faults) = Self::of(path, file, delimiter)?;
        if !ends && let Some((line, error)) = cut(&sheet, delimiter).map_err(failed)? {
            faults.note(line, error);
        }
        Ok((sheet, rows, faults))
    }
}

/// Field separator according to the first line that is no comment.
fn first_delimiter(file: &mut BufReader<File>) -> std::io::Result<u8> {
    let mut line = Vec::new();
    while file.read_until(b'\n', &mut line)? > 0 && is_comment(&line) {
        line.clear();
    }
    Ok(delimiter(&line))
}

/// Returns true if the last line has a line end; an empty file has none that is missing.
fn ends_with_line(file: &mut BufReader<File>) -> std::io::Result<bool> {
    let length = file.seek(SeekFrom::End(0))?;
    if length == 0 {
        return Ok(true);
    }
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    Ok(matches!(last[0], b'\n' | b'\r'))
}

/// Reads a file without a final line end once more, for the error of a last line that seems to be cut off.
fn cut(sheet: &Sheet, delimiter: u8) -> std::io::Result<Option<(usize, ReadError)>> {
    let mut file = BufReader::new(File::open(&sheet.path)?);
    let (mut quotes, mut line) = (0, Vec::new());
    while file.read_until(b'\n', &mut line)? > 0 {
        for byte in &line {
            quotes += usize::from(*byte == b'"');
        }
        if line.ends_with(b"\n") {
            line.clear();
        }
    }
    if is_comment(&line) {
        return Ok(None);
    }
    file.rewind()?;
    let Ok((_, mut rows, mut faults)) = Rows::of(&sheet.path, file, delimiter) else {
        return Ok(None);
    };
    let mut above: VecDeque<String> = VecDeque::new();
    let (mut record, mut last) = (Record::default(), None);
    while rows.next(&mut record, &mut faults) {
        let field = record.cells[sheet.headings.len() - 1].to_owned();
        above.extend(last.replace(field));
        if above.len() > COMPARED {
            above.pop_front();
        }
    }
    let Some(last) = last else { return Ok(None) };
    let ending = Ending { line: record.line, field: &last, is_quote_open: quotes % 2 == 1 };
    Ok(sheet.cut(&ending, above.iter().map(String::as_str)))
}

/// Converts a parser error to one with its line.
fn unequal(path: &Path, comma: bool, error: &csv::Error) -> (usize, ReadError) {
    let line_of = |pos: &Option<csv::Position>| pos.as_ref().map_or(0, |p| p.line() as usize);
    let at =
        |line: usize, text: String| (line, ReadError::new(path, text).at(format!("line {line}")));
    match error.kind() {
        ErrorKind::UnequalLengths { pos, expected_len, len } => {
            let text = format!("expected {expected_len} fields as in the first line, found {len}");
            let (line, error) = at(line_of(pos), text);
            let more = comma && len > expected_len;
            let help =
                "write decimals after a point, not a comma, and put a text with a comma in quotes";
            (line, if more { error.help(help) } else { error })
        }
        ErrorKind::Utf8 { pos, .. } => at(line_of(pos), "is not UTF-8 text".to_owned()),
        _ => (0, ReadError::new(path, format!("cannot be read: {error}"))),
    }
}

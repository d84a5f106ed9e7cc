//! Texts that a study consists of, so that a problem can show the line it concerns.

use std::ops::Range;
use std::path::{Path, PathBuf};

/// Identifies one text of [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(usize);

/// A byte range in one text.
///
/// An empty range at the start of a text denotes the text as a whole.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// The text.
    pub source: SourceId,
    /// Byte range in that text.
    pub span: Range<usize>,
}

impl Place {
    /// A text as a whole.
    pub fn whole(source: SourceId) -> Self {
        Self { source, span: 0..0 }
    }

    /// Returns true if the place is a text as a whole.
    pub fn is_whole(&self) -> bool {
        self.span == (0..0)
    }
}

/// One text: a study file, or an argument of the command line.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name for the user: the path as given, or `--set`.
    pub name: String,
    /// Path of the file; `None` if the text is an argument.
    pub path: Option<PathBuf>,
    /// The text, byte for byte.
    pub text: String,
}

/// Line and column of a place, both counted from 1, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

/// All texts of a study, in the order in which they were read.
#[derive(Clone, Debug, Default)]
pub struct Sources(Vec<Source>);

impl Sources {
    /// Adds the text of a file.
    pub fn add_file(&mut self, path: &Path, text: String) -> SourceId {
        let name = path.display().to_string();
        self.add(Source { name, path: Some(path.to_owned()), text })
    }

    /// Adds the value of a command-line option such as `--set`.
    pub fn add_argument(&mut self, option: &str, text: String) -> SourceId {
        self.add(Source { name: option.to_owned(), path: None, text })
    }

    fn add(&mut self, source: Source) -> SourceId {
        self.0.push(source);
        SourceId(self.0.len() - 1)
    }

    /// One text.
    ///
    /// # Panics
    ///
    /// If the id was returned by another `Sources`.
    pub fn get(&self, id: SourceId) -> &Source {
        &self.0[id.0]
    }

    /// All texts, in the order in which they were read.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.0.iter()
    }

    /// Text of a place, as written.
    pub fn text(&self, place: &Place) -> &str {
        self.get(place.source).text.get(place.span.clone()).unwrap_or("")
    }

    /// The place of a byte range within the value of the string at `place`, with quotes and escapes accounted for;
    /// `place` itself if there is no string.
    pub fn inside(&self, place: &Place, part: &Range<usize>) -> Place {
        let text = self.text(place);
        if !text.starts_with(['"', '\'']) {
            return place.clone();
        }
        let at =
            |byte: usize| place.span.start + raw_offset(text, byte.min(text.len())).min(text.len());
        Place { source: place.source, span: at(part.start)..at(part.end) }
    }

    /// Line and column of the start of a place.
    pub fn position(&self, place: &Place) -> Position {
        let text = &self.get(place.source).text;
        let before = &text[..floor_char(text, place.span.start)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Position {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }

    /// The complete line in which a place begins, without the line ending.
    pub fn line(&self, place: &Place) -> &str {
        let text = &self.get(place.source).text;
        let start = floor_char(text, place.span.start);
        let from = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let to = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
        text[from..to].trim_end_matches('\r')
    }
}

/// Offset in the text (which begins with quotes) of byte `at` of a string's value: TOML 1.0, section "String".
fn raw_offset(text: &str, at: usize) -> usize {
    let quotes = if text.starts_with("\"\"\"") || text.starts_with("'''") { 3 } else { 1 };
    let mut raw = quotes;
    if quotes == 3 {
        let rest = &text[raw..];
        raw += if rest.starts_with("\r\n") { 2 } else { usize::from(rest.starts_with('\n')) };
    }
    if text.starts_with('\'') {
        return raw + at;
    }
    let mut value = 0;
    loop {
        let (length, meaning) = character(&text[raw..]);
        // A backslash at the end of a line continues the string on the next line and adds nothing to the value.
        if length == 0 || (value >= at && meaning > 0) {
            return raw;
        }
        raw += length;
        value += meaning;
    }
}

/// Length in bytes of the next character of a basic string: in the text and in the value.
fn character(text: &str) -> (usize, usize) {
    let mut characters = text.chars();
    let Some(first) = characters.next() else { return (0, 0) };
    if first != '\\' {
        return (first.len_utf8(), first.len_utf8());
    }
    let digits = match characters.next() {
        Some('u') => 4,
        Some('U') => 8,
        Some(c) if c.is_whitespace() => {
            let rest = text[1..].trim_start();
            return (text.len() - rest.len(), 0);
        }
        Some(_) => return (2, 1),
        None => return (1, 0),
    };
    let code = text.get(2..2 + digits).and_then(|hex| u32::from_str_radix(hex, 16).ok());
    let meaning = code.and_then(char::from_u32).map_or(1, char::len_utf8);
    ((2 + digits).min(text.len()), meaning)
}

/// The last character boundary at or before `byte`.
fn floor_char(text: &str, byte: usize) -> usize {
    let mut at = byte.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_strings_are_found_behind_quotes_and_escapes() {
        for (text, part, expected) in [
            (r#""x + y""#, 4..5, "y"),
            ("'x + y'", 4..5, "y"),
            ("\"\"\"\nx +\ny\"\"\"", 4..5, "y"),
            ("'''x +\r\ny'''", 5..6, "y"),
            (r#""\tx \u00B5 \\ y""#, 8..9, "y"),
            ("\"\"\"x + \\\n   y\"\"\"", 4..5, "y"),
            (r#""µ + y""#, 5..6, "y"),
            (r#""x +""#, 3..3, ""),
            (r#""x""#, 9..12, ""),
            ("12", 0..1, "12"),
        ] {
            let mut sources = Sources::default();
            let id = sources.add_file(Path::new("a.toml"), format!("a = {text}"));
            let place = Place { source: id, span: 4..4 + text.len() };
            let inside = sources.inside(&place, &part);
            assert_eq!(sources.text(&inside), expected, "{text}");
        }
    }

    #[test]
    fn positions_count_characters_from_one() {
        let mut sources = Sources::default();
        let id = sources.add_file(Path::new("a.toml"), "a = 1\n\"µε\" = 2\n".into());
        let place = Place { source: id, span: 13..14 };
        assert_eq!(sources.position(&place), Position { line: 2, column: 6 });
        assert_eq!(sources.line(&place), "\"µε\" = 2");
        let inside_a_character = Place { source: id, span: 8..9 };
        assert_eq!(sources.position(&inside_a_character).column, 2);
        let past_the_end = Place { source: id, span: 99..100 };
        assert_eq!(sources.position(&past_the_end), Position { line: 3, column: 1 });
    }
}

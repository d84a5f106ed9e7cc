//! The texts a study was made of, so that a complaint can show the line it is about.

use std::ops::Range;
use std::path::{Path, PathBuf};

/// Which text of [`Sources`] a place is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(usize);

/// A stretch of bytes in one text.
///
/// An empty span at the start of a text stands for the text as a whole.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// The text.
    pub source: SourceId,
    /// Bytes of that text.
    pub span: Range<usize>,
}

impl Place {
    /// The text as a whole.
    pub fn whole(source: SourceId) -> Self {
        Self { source, span: 0..0 }
    }

    /// True when the place is a text as a whole rather than something in it.
    pub fn is_whole(&self) -> bool {
        self.span == (0..0)
    }
}

/// One text: a study file, or an argument of the command line.
#[derive(Clone, Debug)]
pub struct Source {
    /// What the user calls it: the path as given, or `--set`.
    pub name: String,
    /// The file, unless the text is an argument.
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

/// Every text of a study, in the order they were read.
#[derive(Clone, Debug, Default)]
pub struct Sources(Vec<Source>);

impl Sources {
    /// Keeps the text of a file.
    pub fn add_file(&mut self, path: &Path, text: String) -> SourceId {
        let name = path.display().to_string();
        self.add(Source { name, path: Some(path.to_owned()), text })
    }

    /// Keeps the value of a command-line option such as `--set`.
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
    /// When the id was given by another `Sources`.
    pub fn get(&self, id: SourceId) -> &Source {
        &self.0[id.0]
    }

    /// All texts in the order they were read.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.0.iter()
    }

    /// The bytes of a place as written.
    pub fn text(&self, place: &Place) -> &str {
        self.get(place.source).text.get(place.span.clone()).unwrap_or("")
    }

    /// Where a place begins.
    pub fn position(&self, place: &Place) -> Position {
        let text = &self.get(place.source).text;
        let before = &text[..floor_char(text, place.span.start)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Position {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }

    /// The whole line in which a place begins, without its end of line.
    pub fn line(&self, place: &Place) -> &str {
        let text = &self.get(place.source).text;
        let start = floor_char(text, place.span.start);
        let from = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let to = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
        text[from..to].trim_end_matches('\r')
    }
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

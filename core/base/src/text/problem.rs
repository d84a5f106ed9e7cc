//! Problems of a study: one complaint each, its place, and the correct form.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::ops::Range;

use super::node::Node;
use super::source::{Place, Sources};

/// One problem of a study.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Problem {
    /// Place in the text; `None` if the problem has no particular place.
    pub place: Option<Place>,
    /// Byte range within the value of the string at that place, if the problem concerns a part of it.
    pub part: Option<Range<usize>>,
    /// Dotted path of the key concerned; empty if there is none.
    pub path: String,
    /// Description of the problem, in one line.
    pub message: String,
    /// The correct form, phrased to follow "expected".
    pub expected: Option<String>,
    /// The value present, phrased to follow "found".
    pub found: Option<String>,
    /// Advice, one sentence each.
    pub help: Vec<String>,
}

impl Problem {
    /// A problem without a place.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            place: None,
            part: None,
            path: String::new(),
            message: message.into(),
            expected: None,
            found: None,
            help: Vec::new(),
        }
    }

    /// Sets the correct form.
    pub fn expected(&mut self, expected: impl Into<String>) -> &mut Self {
        self.expected = Some(expected.into());
        self
    }

    /// Sets the value present.
    pub fn found(&mut self, found: impl ToString) -> &mut Self {
        self.found = Some(found.to_string());
        self
    }

    /// Adds a piece of advice.
    pub fn help(&mut self, help: impl Into<String>) -> &mut Self {
        self.help.push(help.into());
        self
    }

    /// The problem as plain text, ending in a newline.
    ///
    /// ```text
    /// study.toml:3:9: wrong value for `steps`
    ///   |
    /// 3 | steps = "many"
    ///   |         ^^^^^^
    ///   = expected a whole number, found "many"
    ///   = help: …
    /// ```
    pub fn render(&self, sources: &Sources) -> String {
        let mut text = String::new();
        let mut gutter = 1;
        match &self.place {
            None if self.path.is_empty() => text.push_str(&self.message),
            None => write_text(&mut text, format_args!("`{}`: {}", self.path, self.message)),
            Some(place) => {
                let part = self.part.as_ref().map(|part| sources.inside(place, part));
                gutter = self.render_place(part.as_ref().unwrap_or(place), sources, &mut text);
            }
        }
        text.push('\n');
        for note in self.notes() {
            write_text(&mut text, format_args!("{:gutter$} = {note}\n", ""));
        }
        text
    }

    /// Writes the first line and the excerpt without a final newline; returns the width of the gutter.
    fn render_place(&self, place: &Place, sources: &Sources, text: &mut String) -> usize {
        let source = sources.get(place.source);
        if place.is_whole() {
            write_text(text, format_args!("{}: {}", source.name, self.message));
            return 1;
        }
        let at = sources.position(place);
        let line = sources.line(place).replace('\t', " ");
        let (line, left) = excerpt(line.trim_end(), at.column - 1);
        let width = sources.text(place).lines().next().unwrap_or("").trim_end().chars().count();
        let carets = "^".repeat(width.clamp(1, line.chars().count().saturating_sub(left).max(1)));
        let (head, number) = if source.path.is_some() {
            (format!("{}:{}:{}", source.name, at.line, at.column), at.line.to_string())
        } else {
            (source.name.clone(), " ".to_owned())
        };
        let gutter = number.len();
        write_text(text, format_args!("{head}: {}\n{:gutter$} |\n", self.message, ""));
        write_text(text, format_args!("{number} | {line}\n"));
        write_text(text, format_args!("{:gutter$} | {:left$}{carets}", "", ""));
        gutter
    }

    /// Lines below the excerpt.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        match (&self.expected, &self.found) {
            (Some(expected), Some(found)) => {
                notes.push(format!("expected {expected}, found {found}"));
            }
            (Some(expected), None) => notes.push(format!("expected {expected}")),
            (None, Some(found)) => notes.push(format!("found {found}")),
            (None, None) => {}
        }
        notes.extend(self.help.iter().map(|help| format!("help: {help}")));
        notes
    }
}

/// Largest number of problems that are shown.
const SHOWN: usize = 1000;
/// Largest number of characters of a line that is shown whole.
const LONGEST: usize = 160;
/// Number of characters shown before the place in a longer line.
const BEFORE: usize = 40;

/// The part of a line about a column, and the column of the same character in it.
fn excerpt(line: &str, column: usize) -> (String, usize) {
    if line.chars().nth(LONGEST).is_none() {
        return (line.to_owned(), column);
    }
    let first = column.saturating_sub(BEFORE);
    let mut rest = line.chars().skip(first);
    let shown: String = rest.by_ref().take(LONGEST).collect();
    let [before, after] = [first > 0, rest.next().is_some()].map(|cut| if cut { "…" } else { "" });
    (format!("{before}{shown}{after}"), column - first + before.chars().count())
}

/// Formatting into a `String` cannot fail.
fn write_text(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    let _ = text.write_fmt(arguments);
}

/// All problems of a study, shown together.
#[derive(Clone, Debug, Default)]
pub struct Problems {
    list: Vec<Problem>,
    /// Keys from the root of the study to the value being checked.
    scope: Vec<String>,
}

impl Problems {
    /// An empty collection.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a problem and returns it for further details.
    pub fn report(&mut self, place: Option<Place>, message: impl Into<String>) -> &mut Problem {
        let path = self.path("");
        self.push(Problem { place, path, ..Problem::new(message) })
    }

    /// Adds a problem as given.
    pub fn push(&mut self, problem: Problem) -> &mut Problem {
        self.list.push(problem);
        let last = self.list.len() - 1;
        &mut self.list[last]
    }

    /// Runs `look` with paths relative to `section`.
    pub fn within<R>(&mut self, section: &str, look: impl FnOnce(&mut Self) -> R) -> R {
        self.scope.push(section.to_owned());
        let result = look(self);
        self.scope.pop();
        result
    }

    /// Path from the root of the study of a path relative to the value being checked.
    pub fn path(&self, relative: &str) -> String {
        let mut steps: Vec<&str> = self.scope.iter().map(String::as_str).collect();
        steps.extend((!relative.is_empty()).then_some(relative));
        steps.join(".")
    }

    /// Removes duplicates.
    pub fn dedup(&mut self) {
        let mut seen = HashSet::new();
        self.list.retain(|problem| seen.insert(problem.clone()));
    }

    /// Returns true if there are no problems so far.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Number of problems so far, including duplicates.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// The problems in the order of the texts, without duplicates; those without a place come last.
    pub fn sorted(&self) -> Vec<&Problem> {
        let mut seen = HashSet::new();
        let mut sorted: Vec<&Problem> = self.list.iter().filter(|p| seen.insert(*p)).collect();
        sorted.sort_by_key(|problem| {
            problem
                .place
                .as_ref()
                .map_or((true, None, 0), |place| (false, Some(place.source), place.span.start))
        });
        sorted
    }

    /// The first thousand problems as plain text, separated by empty lines, and the number of the others.
    pub fn render(&self, sources: &Sources) -> String {
        let sorted = self.sorted();
        let shown = sorted.iter().take(SHOWN).map(|problem| problem.render(sources));
        let mut texts: Vec<String> = shown.collect();
        if sorted.len() > SHOWN {
            texts.push(format!("{} further problems are not shown\n", sorted.len() - SHOWN));
        }
        texts.join("\n")
    }
}

impl Extend<Problem> for Problems {
    fn extend<I: IntoIterator<Item = Problem>>(&mut self, problems: I) {
        self.list.extend(problems);
    }
}

/// Reports the problems of a plugin's options; paths are relative to the plugin's section.
///
/// ```ignore
/// complaints.at("degree.max").say("the degree is above the number of runs").found(20).help("…");
/// ```
pub struct Complaints<'a> {
    section: &'a Node,
    problems: &'a mut Problems,
}

impl<'a> Complaints<'a> {
    /// A reporter for `section` that collects in `problems`.
    pub fn new(section: &'a Node, problems: &'a mut Problems) -> Self {
        Self { section, problems }
    }

    /// The value at a dotted path of the section, or its nearest parent that was written.
    pub fn at(&mut self, path: &str) -> Spot<'_> {
        let place = Some(self.section.nearest_place(path));
        let path = self.problems.path(path);
        Spot { place, part: None, path, problems: self.problems }
    }
}

/// The place of a problem that is about to be reported.
#[must_use = "nothing is reported until `say`"]
pub struct Spot<'a> {
    place: Option<Place>,
    part: Option<Range<usize>>,
    path: String,
    problems: &'a mut Problems,
}

impl<'a> Spot<'a> {
    /// Narrows the place to this byte range of the value, which must be a string.
    pub fn inside(self, part: Range<usize>) -> Self {
        Self { part: Some(part), ..self }
    }

    /// Reports the problem and returns it for further details.
    pub fn say(self, message: impl Into<String>) -> &'a mut Problem {
        let Self { place, part, path, problems } = self;
        problems.push(Problem { place, part, path, ..Problem::new(message) })
    }
}

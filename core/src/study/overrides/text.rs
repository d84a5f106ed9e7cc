//! The value of a `--set`: TOML, in which strings need no quotes, since a shell takes them away.

use std::ops::Range;

use super::super::node::{Key, Node, Value};
use super::super::problem::Problems;
use super::super::source::{Place, SourceId};
use super::super::{read, source};

/// The value in some bytes of an argument.
///
/// What is no TOML is the string that it says: `use=external`, `title=Foo's study`, `command=[python, run.py]`. Only what
/// begins with a quote, or with a bracket or brace that is not closed, is meant to be TOML and a syntax error.
pub(super) fn value(
    text: &str,
    span: Range<usize>,
    source: SourceId,
    problems: &mut Problems,
) -> Option<Node> {
    let written = &text[span.clone()];
    let trimmed = written.trim();
    let from = span.start + (written.len() - written.trim_start().len());
    let place = source::Place { source, span: from..from + trimmed.len() };
    let errors = match read::read_value(trimmed, source, from, problems) {
        Ok(node) => return Some(node),
        Err(errors) => errors,
    };
    let inside = from + 1..(from + trimmed.len()).saturating_sub(1);
    let bracketed = |open, close| trimmed.starts_with(open) && trimmed.ends_with(close);
    if bracketed('[', ']') {
        let parts = parts(text, inside);
        let elements = parts.map(|part| value(text, part, source, problems)).collect::<Option<_>>();
        return Some(Node { value: Value::Array(elements?), place });
    }
    if bracketed('{', '}') {
        let parts: Vec<Range<usize>> = parts(text, inside).collect();
        if let Some(entries) = entries(text, &parts, source, problems) {
            return Some(Node { value: Value::Table(entries), place });
        }
    } else if !trimmed.is_empty() && !trimmed.starts_with(['"', '\'', '[', '{', '\n']) {
        return Some(Node::string(trimmed, place));
    }
    read::report(&errors, source, from, problems);
    None
}

/// The entries of a table in braces; `None` where one has no `=`.
fn entries(
    text: &str,
    parts: &[Range<usize>],
    source: SourceId,
    problems: &mut Problems,
) -> Option<Vec<(Key, Node)>> {
    let mut entries = Vec::with_capacity(parts.len());
    for part in parts {
        let equals = super::outside_quotes(&text[part.clone()], '=').next()? + part.start;
        let written = &text[part.start..equals];
        let from = part.start + (written.len() - written.trim_start().len());
        let name = written.trim();
        let place = Place { source, span: from..from + name.len() };
        let name = name.trim_matches(['"', '\'']).to_owned();
        if name.is_empty() {
            return None;
        }
        entries.push((Key { name, place }, value(text, equals + 1..part.end, source, problems)?));
    }
    Some(entries)
}

/// What stands between the commas that are in no quotes, brackets or braces.
fn parts(text: &str, span: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let (mut parts, mut start, mut depth, mut quote) = (Vec::new(), span.start, 0_usize, None);
    for (at, c) in text[span.clone()].char_indices() {
        match (c, quote) {
            (_, Some(open)) if c == open => quote = None,
            ('"' | '\'', None) => quote = Some(c),
            ('[' | '{', None) => depth += 1,
            (']' | '}', None) => depth = depth.saturating_sub(1),
            (',', None) if depth == 0 => {
                parts.push(start..span.start + at);
                start = span.start + at + 1;
            }
            _ => {}
        }
    }
    parts.push(start..span.end);
    // A comma may stand at the end.
    parts
        .into_iter()
        .filter(move |part| !text[part.clone()].trim().is_empty())
        .collect::<Vec<_>>()
        .into_iter()
}

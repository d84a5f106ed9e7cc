//! The value of a `--set`: TOML in which strings need no quotes, because a shell removes them.

use std::ops::Range;

use lacuna::text::node::{Key, Node, Value};
use lacuna::text::problem::Problems;
use lacuna::text::source::{Place, SourceId};
use lacuna::text::{read, source};

/// The value in a range of bytes of an argument.
///
/// Text that is not TOML is a string: `use=external`, `title=Foo's study`, `command=[python, run.py]`. Only text that
/// begins with a quote, or with a bracket or brace that is not closed, is reported as a TOML syntax error.
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

/// The entries of a table in braces; `None` if one of them has no `=`.
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

/// The parts between commas, except those in quotes, brackets or braces.
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
    // A trailing comma is allowed.
    parts
        .into_iter()
        .filter(move |part| !text[part.clone()].trim().is_empty())
        .collect::<Vec<_>>()
        .into_iter()
}

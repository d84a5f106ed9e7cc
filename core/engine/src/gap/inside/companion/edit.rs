//! The study with candidates of its companion, as text.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::run::Stop;
use lacuna::text::emit::to_line;
use lacuna::text::{Problems, Sources, read};
use serde::Serialize;

use crate::gap::result::companion::IdentifiedCompanion;
use crate::study::Study;

/// The text of a study in which its companion has these further candidates, by their names, with the constants that were
/// identified and the point `around` which their changes are learned, by name; `comments` are lines that say why.
pub fn with_added(
    mut text: String,
    study: &Study,
    names: &[&str],
    found: &IdentifiedCompanion,
    around: &BTreeMap<&str, f64>,
    comments: &str,
) -> Result<String, Stop> {
    let Some(companion) = &study.gap.companion else { return Ok(text) };
    let mut add = companion.keys.add.clone();
    add.extend(names.iter().map(|name| (*name).to_owned()));
    let constants = companion.keys.parameter.iter().zip(&found.constants);
    let constants: BTreeMap<String, f64> =
        constants.map(|(own, value)| (own.name.as_str().to_owned(), *value)).collect();
    let mut new = vec![("add", line(&add)?)];
    if !constants.is_empty() {
        new.push(("constants", line(&constants)?));
    }
    new.push(("around", line(around)?));
    let mut missing = String::new();
    for (key, value) in new {
        match span(&text, &format!("gap.companion.{key}")) {
            Some(span) => text.replace_range(span, &value),
            None => missing.push_str(&format!("{key} = {value}\n")),
        }
    }
    let lines = format!("\n{comments}{missing}");
    let header = "[gap.companion]";
    match header_end(&text, header) {
        Some(end) => text.insert_str(end, lines.trim_end()),
        None if missing.is_empty() => {}
        // The table stands in the study that this one extends.
        None => text.push_str(&format!("\n{header}{lines}")),
    }
    Ok(text)
}

/// The end of the line with a header.
fn header_end(text: &str, header: &str) -> Option<usize> {
    let mut begin = 0;
    for line in text.split_inclusive('\n') {
        if line.trim_start().starts_with(header) {
            return Some(begin + line.trim_end_matches('\n').len());
        }
        begin += line.len();
    }
    None
}

/// The bytes of a value in a study.
fn span(text: &str, path: &str) -> Option<std::ops::Range<usize>> {
    let mut sources = Sources::default();
    let source = sources.add_file(Path::new("study"), text.to_owned());
    let root = read::read(source, &sources, &mut Problems::new())?;
    Some(root.find(path)?.place.span.clone())
}

fn line(value: &impl Serialize) -> Result<String, Stop> {
    to_line(value).map_err(|error| Stop::new(format!("the new study {error}")))
}

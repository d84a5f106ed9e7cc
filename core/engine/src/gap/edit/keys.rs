//! Keys of a table in the text of a study.

use std::ops::Range;
use std::path::Path;

use lacuna::text::{Problems, Sources, read};

/// The text of a study in which a table, given by its header such as `[gap]`, has these keys with these values;
/// `comments` are lines that say why. A table that is not in the text is put at its end: it may stand in the study that
/// this one extends.
pub fn with_keys(
    mut text: String,
    header: &str,
    keys: Vec<(&str, String)>,
    comments: &str,
) -> String {
    let table = header.trim_matches(['[', ']']);
    let mut missing = String::new();
    for (key, value) in keys {
        match span(&text, &format!("{table}.{key}")) {
            Some(span) => text.replace_range(span, &value),
            None => missing.push_str(&format!("{key} = {value}\n")),
        }
    }
    let lines = format!("\n{comments}{missing}");
    match header_end(&text, header) {
        Some(end) => text.insert_str(end, lines.trim_end()),
        None if missing.is_empty() => {}
        None => text.push_str(&format!("\n{header}{lines}")),
    }
    text
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
fn span(text: &str, path: &str) -> Option<Range<usize>> {
    let mut sources = Sources::default();
    let source = sources.add_file(Path::new("study"), text.to_owned());
    let root = read::read(source, &sources, &mut Problems::new())?;
    Some(root.find(path)?.place.span.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_replaced_or_put_below_the_header_or_at_the_end() {
        let keys = || vec![("add", "[\"a\", \"b\"]".to_owned())];
        let told = |text: &str| with_keys(text.to_owned(), "[gap]", keys(), "# why\n");
        assert_eq!(told("[gap]\nadd = [\"a\"]\n"), "[gap]\n# why\nadd = [\"a\", \"b\"]\n");
        assert_eq!(
            told("[gap] # search\neffects = 2\n"),
            "[gap] # search\n# why\nadd = [\"a\", \"b\"]\neffects = 2\n"
        );
        assert_eq!(
            told("extends = \"x.toml\"\n"),
            "extends = \"x.toml\"\n\n[gap]\n# why\nadd = [\"a\", \"b\"]\n"
        );
    }
}

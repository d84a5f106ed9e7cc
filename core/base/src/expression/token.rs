//! Tokens of an expression.

use std::ops::Range;

use super::Fault;

/// A token and its byte range.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Token {
    pub kind: Kind,
    pub span: Range<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Number(f64),
    /// A name that is not a keyword.
    Name,
    /// A unit in braces; the byte range includes the braces.
    Unit,
    /// An operator, a bracket, or one of `and`, `or`, `not`.
    Symbol(&'static str),
    End,
}

/// Keywords, which cannot be names.
pub(super) const KEYWORDS: [&str; 3] = ["and", "or", "not"];

/// Longer symbols come before their prefixes.
const SYMBOLS: [&str; 20] = [
    "<=", ">=", "==", "!=", "**", "<", ">", "=", "+", "-", "*", "/", "^", "(", ")", "[", "]", ",",
    ":", "}",
];

impl Token {
    /// Description of the token in a message, after "found".
    pub fn describe(&self, text: &str) -> String {
        match self.kind {
            Kind::End => "the end".to_owned(),
            _ => format!("`{}`", &text[self.span.clone()]),
        }
    }
}

/// All tokens of a text; the last one is the end.
pub(super) fn tokens(text: &str) -> Result<Vec<Token>, Fault> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let (kind, length) = if c.is_whitespace() {
            at += c.len_utf8();
            continue;
        } else if starts_number(rest) {
            number(text, at)?
        } else if c.is_ascii_alphabetic() || c == '_' {
            let length = name_length(rest);
            let keyword = KEYWORDS.into_iter().find(|word| *word == &rest[..length]);
            (keyword.map_or(Kind::Name, Kind::Symbol), length)
        } else if c == '{' {
            let length = rest.find('}').ok_or_else(|| {
                Fault::new(at..at + 1, "this `{` is not closed").expected("a unit and `}`")
            })?;
            (Kind::Unit, length + 1)
        } else if let Some(symbol) = SYMBOLS.into_iter().find(|s| rest.starts_with(s)) {
            (Kind::Symbol(symbol), symbol.len())
        } else {
            return Err(stranger(at, c));
        };
        found.push(Token { kind, span: at..at + length });
        at += length;
    }
    found.push(Token { kind: Kind::End, span: text.len()..text.len() });
    Ok(found)
}

/// Returns true for a valid name of an expression: letters, digits and `_`, no digit first, not a keyword.
pub fn is_name(text: &str) -> bool {
    !text.is_empty()
        && !text.starts_with(|c: char| c.is_ascii_digit())
        && name_length(text) == text.len()
        && !KEYWORDS.contains(&text)
}

fn name_length(text: &str) -> usize {
    text.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(text.len())
}

fn starts_number(text: &str) -> bool {
    text.strip_prefix('.').unwrap_or(text).starts_with(|c: char| c.is_ascii_digit())
}

fn number(text: &str, at: usize) -> Result<(Kind, usize), Fault> {
    let rest = &text[at..];
    let digits = |from: usize| {
        let more = rest[from..].find(|c: char| !c.is_ascii_digit());
        more.map_or(rest.len(), |length| from + length)
    };
    let mut end = digits(0);
    if rest[end..].starts_with('.') {
        end = digits(end + 1);
    }
    if rest[end..].starts_with(['e', 'E']) {
        let signed = end + 1 + usize::from(rest[end + 1..].starts_with(['+', '-']));
        if rest[signed..].starts_with(|c: char| c.is_ascii_digit()) {
            end = digits(signed);
        }
    }
    match rest[..end].parse::<f64>() {
        Ok(x) if x.is_finite() => Ok((Kind::Number(x), end)),
        _ => Err(Fault::new(at..at + end, "the number is too large")
            .expected(format!("at most {:e}", f64::MAX))),
    }
}

fn stranger(at: usize, c: char) -> Fault {
    let fault = Fault::new(at..at + c.len_utf8(), format!("`{c}` has no meaning here"));
    match c {
        '&' => fault.help("write `and`"),
        '|' => fault.help("write `or`, or `abs(x)` for a magnitude"),
        '!' => fault.help("write `not`"),
        '%' => fault.help("a per cent is a factor: `0.01 * x`"),
        '×' | '·' => fault.help("a product is written `*`"),
        '−' | '–' => fault.help("a minus is written `-`"),
        '"' | '\'' => fault.help("an expression has no quotes inside"),
        c if c.is_alphabetic() => fault.help("names are of the letters a to z, digits and `_`"),
        _ => fault,
    }
}

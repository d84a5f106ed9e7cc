//! Decoding of responses.

use serde::de::DeserializeOwned;

use super::Error;
use crate::protocol::Failed;

/// Largest number of characters of a response that are shown.
const SHOWN: usize = 120;

/// Decodes a response: the HTTP status and the body with which the server at `url` answered.
pub fn read<T: DeserializeOwned>(url: &str, status: u16, body: &[u8]) -> Result<T, Error> {
    let url = url.to_owned();
    let text = with_nulls(&String::from_utf8_lossy(body));
    if let Ok(Failed { error: fault }) = serde_json::from_str(&text) {
        return Err(Error::Fault { url, fault });
    }
    match status {
        200..=299 => serde_json::from_str(&text).map_err(|error| {
            let reason = format!("{error}{}", beginning(&text));
            Error::Useless { url, reason }
        }),
        502..=504 => {
            let reason = format!("HTTP status {status}{}", beginning(&text));
            Err(Error::Unreachable { url, reason })
        }
        500..=599 => {
            let reason = format!("HTTP status {status}{}", beginning(&text));
            Err(Error::Useless { url, reason })
        }
        _ => Err(Error::Foreign { url, status, text: beginning(&text) }),
    }
}

/// The first line, after a colon; empty if there is none.
fn beginning(text: &str) -> String {
    let line = text.trim_start().lines().next().unwrap_or_default().trim_end();
    let shown: String = line.chars().take(SHOWN).collect();
    let dots = if shown.len() < line.len() { "…" } else { "" };
    if shown.is_empty() { String::new() } else { format!(": `{shown}{dots}`") }
}

/// Replaces NaN and infinities by `null`: JSON has neither, but servers write them (Python as `nan`, `inf`, `NaN`,
/// `Infinity`; other libraries as `null`).
fn with_nulls(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(|c: char| c == '"' || c.is_ascii_alphabetic()) {
        let (before, from) = rest.split_at(at);
        out.push_str(before);
        let end = if from.starts_with('"') { string(from) } else { word(from) };
        let (token, after) = from.split_at(end);
        if ["nan", "inf", "infinity"].contains(&token.to_ascii_lowercase().as_str()) {
            out.truncate(out.trim_end_matches(['-', '+']).len());
            out.push_str("null");
        } else {
            out.push_str(token);
        }
        rest = after;
    }
    out + rest
}

/// Length of the string at the beginning, including its quotes.
fn string(text: &str) -> usize {
    let mut escaped = false;
    for (i, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return i + 1,
            _ => {}
        }
    }
    text.len()
}

/// Length of the word at the beginning.
fn word(text: &str) -> usize {
    text.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_becomes_null_and_strings_stay() {
        let text = r#"{"output": [[1e-5, NaN, -Infinity, nan,-inf], [true]], "NaN": "a \" nan"}"#;
        let expected = r#"{"output": [[1e-5, null, null, null,null], [true]], "NaN": "a \" nan"}"#;
        assert_eq!(with_nulls(text), expected);
        assert_eq!(with_nulls("\"open nan"), "\"open nan");
        assert_eq!(with_nulls("nan"), "null");
    }
}

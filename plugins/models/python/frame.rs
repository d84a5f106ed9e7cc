//! Answers of a worker: a line of JSON, followed by doubles.

use std::io::{self, BufRead, Read as _};

use serde::Deserialize;

/// One answer.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// Result values.
    Values(Vec<f64>),
    /// Error message.
    Failed(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Heading {
    #[serde(rename = "count")]
    Count(usize),
    #[serde(rename = "error")]
    Error(String),
}

/// Reads one answer; `None` at the end.
pub fn read(source: &mut impl BufRead) -> io::Result<Option<Answer>> {
    let mut line = String::new();
    if source.read_line(&mut line)? == 0 {
        return Ok(None);
    }
    let heading = serde_json::from_str(&line).map_err(io::Error::other)?;
    let count = match heading {
        Heading::Error(text) => return Ok(Some(Answer::Failed(text))),
        Heading::Count(count) => count,
    };
    let mut bytes = Vec::new();
    source.take(8 * count as u64).read_to_end(&mut bytes)?;
    if bytes.len() != 8 * count {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let (numbers, _) = bytes.as_chunks::<8>();
    Ok(Some(Answer::Values(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())))
}

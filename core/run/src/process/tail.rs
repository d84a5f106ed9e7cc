//! The end of a program's output, for messages.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// Number of bytes at the end of a file that are read.
const BYTES: u64 = 4096;
const LINES: usize = 5;
const CHARACTERS: usize = 200;

/// The last lines that are not blank; long lines are cut.
pub fn tail(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<String> = text
        .lines()
        .map(str::trim_end)
        .filter(|line| !line.is_empty())
        .map(|line| line.chars().filter(|c| !c.is_control() || *c == '\t').collect())
        .map(|line: String| match line.char_indices().nth(CHARACTERS) {
            Some((cut, _)) => format!("{}…", &line[..cut]),
            None => line,
        })
        .collect();
    lines[lines.len().saturating_sub(LINES)..].join("\n")
}

/// The last lines of a file; empty if it cannot be read.
pub fn tail_of_file(path: &Path) -> String {
    let end = || -> std::io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(BYTES)))?;
        let mut bytes = Vec::new();
        file.take(BYTES).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    tail(&end().unwrap_or_default())
}

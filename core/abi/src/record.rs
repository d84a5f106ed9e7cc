//! The plain text in which a library describes itself, so that it can be looked at without being loaded.
//!
//! ```text
//! lacuna-plugin-record:1.2
//! discrepancy=matern
//! end
//! ```

/// The plugins of a library, as the text in its file lists them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// The version of the boundary for which it was made; `None` for a Python file.
    pub abi: Option<(u32, u32)>,
    /// Kind and name of each plugin.
    pub plugins: Vec<(String, String)>,
}

/// The beginning of a record.
const BEGIN: &[u8] = b"lacuna-plugin-record:";

/// The longest line of a record.
const LINE: usize = 256;

/// Finds the record in the bytes of a library. What only looks like the beginning of one is passed over.
pub fn find(bytes: &[u8]) -> Option<Record> {
    let starts =
        (0..bytes.len().saturating_sub(BEGIN.len())).filter(|&i| bytes[i..].starts_with(BEGIN));
    starts.into_iter().find_map(|start| read(&bytes[start + BEGIN.len()..]))
}

fn read(mut rest: &[u8]) -> Option<Record> {
    let (major, minor) = line(&mut rest)?.split_once('.')?;
    let abi = Some((major.parse().ok()?, minor.parse().ok()?));
    let mut plugins = Vec::new();
    loop {
        let line = line(&mut rest)?;
        if line == "end" {
            return Some(Record { abi, plugins });
        }
        let (kind, name) = line.split_once('=')?;
        if !is_word(kind) || !is_word(name) {
            return None;
        }
        plugins.push((kind.to_owned(), name.to_owned()));
    }
}

/// Takes a line off the beginning.
fn line<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    let end = rest.iter().take(LINE).position(|&byte| byte == b'\n')?;
    let (line, after) = rest.split_at(end);
    *rest = &after[1..];
    std::str::from_utf8(line).ok()
}

/// True for a text that can be the name of a kind or a plugin.
pub fn is_word(text: &str) -> bool {
    let inside = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    text.starts_with(|c: char| c.is_ascii_lowercase()) && text.chars().all(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_found_among_other_bytes() {
        let mut bytes = vec![0, 1, 2];
        // The words of a program that looks for records are no record.
        bytes.extend(b"lacuna-plugin-record:lacuna-plugin-record:nonsense\n");
        assert_eq!(find(&bytes), None);
        bytes
            .extend(b"\0lacuna-plugin-record:1.2\ndiscrepancy=matern\nsampler=walk_2\nend\n\0more");
        let plugins = [("discrepancy", "matern"), ("sampler", "walk_2")]
            .map(|(k, n)| (k.to_owned(), n.to_owned()));
        assert_eq!(find(&bytes), Some(Record { abi: Some((1, 2)), plugins: plugins.to_vec() }));
        assert_eq!(find(b"lacuna-plugin-record:1.2\nno plugin\nend\n"), None);
        assert_eq!(find(b"lacuna-plugin-record:1.2\nsampler=walk\n"), None);
    }
}

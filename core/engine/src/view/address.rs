//! Addresses: parts of a path, and names of runs in a query.

/// Parts of a path, decoded; the last one is empty if the path ends in `/`.
///
/// `None` for a path that could lead elsewhere: with `.` or `..`, an empty or a hidden part, a separator or a control
/// character inside a part, or what is no UTF-8.
pub(super) fn parts(path: &str) -> Option<Vec<String>> {
    let mut parts: Vec<String> = path
        .strip_prefix('/')?
        .split('/')
        .map(|part| decoded(part, false))
        .collect::<Option<_>>()?;
    let last = parts.pop()?;
    let is_sound = |part: &String| {
        !part.is_empty()
            && !part.starts_with('.')
            && !part.contains(|c: char| {
                matches!(c, '/' | '\\') || (cfg!(windows) && c == ':') || c.is_control()
            })
    };
    if !parts.iter().all(is_sound) || !(last.is_empty() || is_sound(&last)) {
        return None;
    }
    parts.push(last);
    Some(parts)
}

/// Values of a key in a query, in order; `None` if one of them is not encoded correctly.
pub(super) fn values(query: &str, key: &str) -> Option<Vec<String>> {
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    pairs.filter(|(name, _)| *name == key).map(|(_, value)| decoded(value, true)).collect()
}

/// A text with its percent signs decoded; in a query a plus sign is a space.
fn decoded(text: &str, in_query: bool) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut left = text.bytes();
    while let Some(byte) = left.next() {
        match byte {
            b'%' => {
                let digit = |c: Option<u8>| char::from(c?).to_digit(16);
                let (high, low) = (digit(left.next())?, digit(left.next())?);
                bytes.push((16 * high + low) as u8);
            }
            b'+' if in_query => bytes.push(b' '),
            other => bytes.push(other),
        }
    }
    String::from_utf8(bytes).ok()
}

/// A name as part of an address.
pub(super) fn encoded(name: &str) -> String {
    let one = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => {
            char::from(byte).to_string()
        }
        other => format!("%{other:02X}"),
    };
    name.bytes().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_leads_out_of_the_folder() {
        let parts = |path| parts(path).map(|parts| parts.join("|"));
        assert_eq!(parts("/").as_deref(), Some(""));
        assert_eq!(parts("/runs/a%20b/").as_deref(), Some("runs|a b|"));
        assert_eq!(parts("/runs/a+b/figures/x.svg").as_deref(), Some("runs|a+b|figures|x.svg"));
        for wrong in [
            "",
            "runs",
            "http://else/",
            "//etc/passwd",
            "/runs/../../etc/passwd",
            "/runs/%2e%2e/x",
            "/runs/a/%2E%2e",
            "/runs/..%2f..%2fetc",
            "/runs/a%5c..%5cb",
            "/runs/a/.lock",
            "/runs/a/.kept/x",
            "/runs/a/%00",
            "/runs/a/%zz",
            "/runs/a/%f",
            "/runs/a/%ff",
        ] {
            assert_eq!(parts(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn names_survive_an_address() {
        for name in ["sns", "a b+effect", "déjà/vu", "100%"] {
            assert_eq!(decoded(&encoded(name), false).as_deref(), Some(name));
            assert_eq!(values(&format!("x=1&run={}", encoded(name)), "run").unwrap(), [name]);
        }
        assert_eq!(values("run=a+b&run=c", "run").unwrap(), ["a b", "c"]);
        assert_eq!(values("run=%", "run"), None);
    }
}

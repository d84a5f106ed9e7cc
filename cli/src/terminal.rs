//! Standard output and standard error: text of studies and data cannot command the terminal, a closed pipe ends nothing, and
//! output that cannot be written is an error.

use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::events;
use crate::layout::fitted;

/// Smallest number of columns into which text is fitted.
const NARROWEST: usize = 40;

/// True once standard output could not be written for another reason than a closed pipe.
static FAILED: AtomicBool = AtomicBool::new(false);

/// Prints a line to standard output.
pub fn print(text: &str) {
    if events::are_on() { events::text(text) } else { print_styled(&clean(text)) }
}

/// Prints data, which a file or a pipe receives as they are.
pub fn print_data(text: &str) {
    if std::io::stdout().is_terminal() || events::are_on() {
        print(text);
    } else {
        print_styled(text);
    }
}

/// Prints sentences and tables so that they fit into a terminal; what is written into a file or a pipe has long lines.
pub fn show(text: &str) {
    match columns().filter(|_| !events::are_on()) {
        Some(width) => print_styled(&fitted(&clean(text), width)),
        None => print(text),
    }
}

/// Number of columns of the terminal on standard output; `None` if it is none.
fn columns() -> Option<usize> {
    if !std::io::stdout().is_terminal() {
        return None;
    }
    let stated = std::env::var("COLUMNS").ok().and_then(|text| text.parse::<usize>().ok());
    let size = || console::Term::stdout().size_checked().map(|(_, columns)| usize::from(columns));
    stated.filter(|&width| width > 0).or_else(size).map(|width| width.max(NARROWEST))
}

/// Prints a line that has escape sequences of its own.
pub fn print_styled(text: &str) {
    let mut out = std::io::stdout().lock();
    note(writeln!(out, "{text}").and_then(|()| out.flush()));
}

/// Remembers that standard output did not take all.
pub fn note(written: std::io::Result<()>) {
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            FAILED.store(true, Ordering::Relaxed);
        }
        // Who closes a pipe has read enough.
        _ => {}
    }
}

/// Number of characters of a line of a message that are shown: a file, a server or a simulator may have given more.
const LONGEST: usize = 2000;

/// Prints a message to standard error, with long lines cut.
pub fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", clean(&cut(text)));
}

/// The text with the beginning of each line that is too long.
fn cut(text: &str) -> String {
    let shown = |line: &str| match line.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}… ({} bytes more)", &line[..end], line.len() - end),
        None => line.to_owned(),
    };
    text.split('\n').map(shown).collect::<Vec<_>>().join("\n")
}

/// True if standard output has not received all that was printed.
pub fn has_failed() -> bool {
    FAILED.load(Ordering::Relaxed)
}

/// Characters that change the order in which those after them are shown.
const REORDERS: [char; 9] = [
    '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}', '\u{2066}', '\u{2067}', '\u{2068}',
    '\u{2069}',
];

/// Text without control characters but ends of lines and tabs; a character that commands a terminal is shown as a picture
/// of itself.
pub fn clean(text: &str) -> String {
    let shown = |c: char| match c {
        '\n' | '\t' => c,
        '\u{7f}' => '\u{2421}',
        c if u32::from(c) < 0x20 => char::from_u32(0x2400 + u32::from(c)).unwrap_or('\u{fffd}'),
        c if c.is_control() || REORDERS.contains(&c) => '\u{fffd}',
        c => c,
    };
    text.chars().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::{LONGEST, clean, cut};

    #[test]
    fn long_lines_of_messages_are_cut() {
        let long = "µ".repeat(LONGEST + 7);
        let expected = format!("a\n{}… (14 bytes more)\nb", "µ".repeat(LONGEST));
        assert_eq!(cut(&format!("a\n{long}\nb")), expected);
        assert_eq!(cut("short\n"), "short\n");
    }

    #[test]
    fn text_cannot_command_a_terminal() {
        assert_eq!(clean("a\u{1b}[31mb\tc\nd\r\u{9b}2J\u{7f}"), "a␛[31mb\tc\nd␍\u{fffd}2J␡");
        assert_eq!(clean("σ² ± 0.1 µm"), "σ² ± 0.1 µm");
        assert_eq!(clean("gpj\u{202e}exe"), "gpj\u{fffd}exe");
    }
}

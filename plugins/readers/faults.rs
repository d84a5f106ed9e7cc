//! All errors of a file, to be reported together.

use lacuna::plugin::reader::ReadError;

/// Maximum number of different errors reported for a file.
const TOLD: usize = 20;

/// Errors of one file, in the order of its lines. Each message is reported once, with the number of further lines to
/// which it applies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Faults {
    found: Vec<Fault>,
    /// Number of errors that are not reported.
    untold: usize,
}

#[derive(Debug, Clone, PartialEq)]
struct Fault {
    line: usize,
    error: ReadError,
    /// Number of further lines with the same message.
    again: usize,
}

impl Faults {
    /// Returns true if there are no errors.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Adds an error of a line; line 0 stands for the whole file.
    pub fn note(&mut self, line: usize, error: ReadError) {
        let same = |known: &&mut Fault| known.line > 0 && known.error.message == error.message;
        if let Some(known) = self.found.iter_mut().find(same) {
            known.again += 1;
        } else if self.found.len() < TOLD {
            self.found.push(Fault { line, error, again: 0 });
        } else {
            self.untold += 1;
        }
    }

    /// Returns the value that was read, or adds its error.
    pub fn take<T>(&mut self, line: usize, read: Result<T, ReadError>) -> Option<T> {
        read.map_err(|error| self.note(line, error)).ok()
    }

    /// Adds the errors of another pass over the same file.
    pub fn add(&mut self, other: Self) {
        self.found.extend(other.found);
        self.untold += other.untold;
    }

    /// Returns the value if there are no errors, otherwise all errors as one.
    pub fn or<T>(mut self, value: T) -> Result<T, ReadError> {
        self.found.sort_by_key(|fault| fault.line);
        let Some(last) = self.found.last_mut() else { return Ok(value) };
        if self.untold > 0 {
            let text = format!("{} further errors are not listed", self.untold);
            let path = last.error.path.clone();
            last.error.further.push(ReadError::new(path, text));
        }
        let told = self.found.into_iter().map(|fault| match fault.again {
            0 => fault.error,
            1 => ReadError {
                message: format!("{} (and in 1 more line)", fault.error.message),
                ..fault.error
            },
            n => ReadError {
                message: format!("{} (and in {n} more lines)", fault.error.message),
                ..fault.error
            },
        });
        ReadError::of_all(told).map_or(Ok(value), Err)
    }
}

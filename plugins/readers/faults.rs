//! All that is wrong with a file, to be told at once.

use lacuna::plugin::reader::ReadError;

/// How many different errors of a file are told.
const TOLD: usize = 20;

/// Errors of one file, in the order of its lines. Each message is told once, with how many more lines it is true of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Faults {
    found: Vec<Fault>,
    /// How many are not told.
    untold: usize,
}

#[derive(Debug, Clone, PartialEq)]
struct Fault {
    line: usize,
    error: ReadError,
    /// In how many further lines.
    again: usize,
}

impl Faults {
    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Notes an error in a line; zero for one about the whole file.
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

    /// What was read, or what is wrong.
    pub fn take<T>(&mut self, line: usize, read: Result<T, ReadError>) -> Option<T> {
        read.map_err(|error| self.note(line, error)).ok()
    }

    /// Adds the errors of another look at the same file.
    pub fn add(&mut self, other: Self) {
        self.found.extend(other.found);
        self.untold += other.untold;
    }

    /// The value, if nothing is wrong.
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

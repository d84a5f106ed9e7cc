//! Bytes of a file in one byte order, each access checked against their end.

use std::path::Path;

use lacuna::plugin::reader::ReadError;

/// A fault of a file, and the byte where it is.
#[derive(Debug)]
pub(super) struct Fault {
    pub at: u64,
    pub text: String,
}

impl Fault {
    pub fn new(at: u64, text: impl Into<String>) -> Self {
        Self { at, text: text.into() }
    }

    /// The error about a file.
    pub fn of(self, path: &Path) -> ReadError {
        ReadError::new(path, self.text).at(format!("byte {}", self.at))
    }
}

/// Bytes that are read one after the other.
pub(super) struct Bytes<'a> {
    rest: &'a [u8],
    /// Position in the file of the first byte of `rest`.
    at: u64,
    /// True if numbers have their highest byte first.
    big: bool,
}

impl<'a> Bytes<'a> {
    pub fn new(bytes: &'a [u8], at: u64, big: bool) -> Self {
        Self { rest: bytes, at, big }
    }

    /// Position in the file of the next byte.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Takes a number of bytes; fails if fewer are left. Nothing is allocated.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let Some((taken, rest)) = self.rest.split_at_checked(count) else {
            let left = self.rest.len();
            let text =
                format!("expected {count} bytes, found the {left} that are left of the part");
            return Err(Fault::new(self.at, text));
        };
        self.rest = rest;
        self.at += count as u64;
        Ok(taken)
    }

    /// Takes bytes in the order of a machine that has the lowest first.
    pub fn lowest_first<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let big = self.big;
        Ok(lowest_first(self.take(N)?, big))
    }

    pub fn u32(&mut self) -> Result<u32, Fault> {
        Ok(u32::from_le_bytes(self.lowest_first()?))
    }

    pub fn u64(&mut self) -> Result<u64, Fault> {
        Ok(u64::from_le_bytes(self.lowest_first()?))
    }

    /// Takes a text: its length in bytes, then UTF-8. Bytes that are not UTF-8 become the mark of a replacement.
    pub fn text(&mut self) -> Result<String, Fault> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

/// The first bytes of a slice, which has at least as many, with the lowest first.
pub(super) fn lowest_first<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
    let mut own = [0; N];
    own.copy_from_slice(&bytes[..N]);
    if big {
        own.reverse();
    }
    own
}

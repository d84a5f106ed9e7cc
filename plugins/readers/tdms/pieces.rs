//! Samples of a channel in the raw data of the file.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};

use super::kind::Kind;

/// Number of bytes that are read at once, if the file has as many.
const BLOCK: u64 = 1 << 20;

/// Samples of one segment: `chunks` times `count` samples. All of them are inside of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    pub kind: Kind,
    pub big: bool,
    /// Position of the first sample.
    pub start: u64,
    pub count: u64,
    /// Bytes from a sample to the next.
    pub step: u64,
    pub chunks: u64,
    /// Bytes from a chunk to the next.
    pub chunk: u64,
}

impl Piece {
    /// Number of samples.
    pub fn len(&self) -> u64 {
        self.count * self.chunks
    }
}

/// Calls a function with the bytes of each sample.
pub(super) fn each(
    file: &File,
    pieces: &[Piece],
    mut sample: impl FnMut(&Piece, &[u8]),
) -> io::Result<()> {
    let mut block = Block { file, start: 0, bytes: Vec::new() };
    for piece in pieces {
        let size = piece.kind.size();
        let end = piece.start
            + piece.chunks.saturating_sub(1) * piece.chunk
            + piece.count.saturating_sub(1) * piece.step
            + size as u64;
        for chunk in 0..piece.chunks {
            for i in 0..piece.count {
                let at = piece.start + chunk * piece.chunk + i * piece.step;
                sample(piece, block.at(at, size, end)?);
            }
        }
    }
    Ok(())
}

/// Bytes of a file in memory.
struct Block<'a> {
    file: &'a File,
    start: u64,
    bytes: Vec<u8>,
}

impl Block<'_> {
    /// The bytes at a position; nothing behind `end` is read.
    fn at(&mut self, at: u64, size: usize, end: u64) -> io::Result<&[u8]> {
        let inside = at >= self.start && at + size as u64 <= self.start + self.bytes.len() as u64;
        if !inside {
            self.bytes = part(self.file, at, BLOCK.max(size as u64).min(end - at))?;
            self.start = at;
        }
        let from = (at - self.start) as usize;
        Ok(&self.bytes[from..from + size])
    }
}

/// Reads a part of a file, which has this many bytes.
pub(super) fn part(mut file: &File, start: u64, length: u64) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; length as usize];
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

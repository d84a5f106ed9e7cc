//! Another side that says whatever some bytes say, for tests of what this side makes of it.
//!
//! Its pointers lead to memory that is there, or are null: what else a pointer may be, no check can tell.

use std::ffi::c_void;

use crate::basic::{Answer, Numbers, Text};
use crate::table::{ModelFunctions, copied};
use crate::{Refusal, Reply};

/// Takes numbers off the beginning of bytes.
struct Take<'a>(&'a [u8]);

impl<'a> Take<'a> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn word(&mut self) -> Option<usize> {
        let (first, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        usize::try_from(u64::from_le_bytes(*first)).ok()
    }

    fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (first, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        first
    }
}

/// The reply to a call that answers as the bytes say: texts and matrices of any size that has no memory behind it, or that
/// is there, and any status.
pub fn reply(bytes: &[u8]) -> Result<Reply, Refusal> {
    let numbers: Vec<f64> = (0..64).map(f64::from).collect();
    Reply::of("call", |answer| {
        // SAFETY: the answer is that of the call that is under way.
        let answer: Answer = unsafe { *answer };
        let mut take = Take(bytes);
        while let Some(what) = take.byte() {
            // SAFETY: what is given is there during the call, or says of itself that it cannot be.
            match what {
                0 => unsafe {
                    text(&answer, take.byte().map_or(&[][..], |n| take.bytes(n.into())));
                },
                1 => unsafe { odd_text(&answer, take.word().unwrap_or(0)) },
                2 => {
                    let (rows, columns) = (take.word().unwrap_or(0), take.word().unwrap_or(0));
                    unsafe { matrix(&answer, &numbers, rows, columns) }
                }
                other => return i32::from(other) - 3,
            }
        }
        crate::status::OK
    })
}

/// Gives a text that is there.
unsafe fn text(answer: &Answer, bytes: &[u8]) {
    if let Some(give) = answer.text {
        // SAFETY: as the caller promises.
        unsafe { give(answer.context, Text::of_bytes(bytes)) }
    }
}

/// Gives a text of which there is nothing: a null pointer, or more bytes than memory has addresses.
unsafe fn odd_text(answer: &Answer, length: usize) {
    let there = std::ptr::dangling::<u8>();
    let bytes = if isize::try_from(length).is_ok() { std::ptr::null() } else { there };
    if let Some(give) = answer.text {
        // SAFETY: as the caller promises.
        unsafe { give(answer.context, Text { bytes, length }) }
    }
}

/// Gives a matrix: of numbers that are there, or of none where it says that it has more.
unsafe fn matrix(answer: &Answer, numbers: &[f64], rows: usize, columns: usize) {
    let is_there = rows.checked_mul(columns).is_some_and(|count| count <= numbers.len());
    let values = if is_there { numbers.as_ptr() } else { std::ptr::null() };
    if let Some(give) = answer.numbers {
        // SAFETY: as the caller promises.
        unsafe { give(answer.context, Numbers { values, rows, columns }) }
    }
}

/// A table of functions whose size and presence the bytes say: the first eight are its size, each other says whether there
/// is a function. None of them is called.
pub fn table(bytes: &[u8]) -> Result<(), Refusal> {
    unsafe extern "C" fn nothing(_: *mut c_void) {}
    let mut take = Take(bytes);
    let size = take.word().unwrap_or(0);
    let function = nothing as *const () as usize;
    let mut words = vec![0_usize; 64];
    words[0] = size;
    for (word, byte) in words[1..].iter_mut().zip(take.0) {
        *word = if byte % 2 == 1 { function } else { 0 };
    }
    // A size beyond what is there is one that only its owner could know to be wrong.
    words[0] = if size > 8 * words.len() { size % 512 } else { size };
    // SAFETY: there are as many bytes as the table says, and words of functions are null or lead to one.
    unsafe { copied::<ModelFunctions>(words.as_ptr().cast()) }.map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes of a linear congruential generator (Knuth, MMIX), small values among them, which are the codes of parts.
    fn bytes(seed: u64, count: usize) -> Vec<u8> {
        let mut state = seed;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        };
        (0..count).map(|_| if next() < 128 { next() % 5 } else { next() }).collect()
    }

    #[test]
    fn whatever_is_answered_is_refused_or_whole() {
        for seed in 0..200 {
            match reply(&bytes(seed, 60)) {
                Ok(reply) => {
                    for matrix in &reply.matrices {
                        assert_eq!(matrix.as_slice().len(), matrix.rows() * matrix.columns());
                    }
                }
                Err(refusal) => assert_ne!(refusal.status, crate::status::OK, "{refusal:?}"),
            }
        }
    }

    #[test]
    fn whatever_a_table_says_of_itself_is_refused_or_taken() {
        for seed in 0..200 {
            let mut bytes = bytes(seed, 80);
            // Half of the tables have a size that is possible.
            if seed % 2 == 0 {
                bytes[..8].copy_from_slice(&(8 * (seed % 64)).to_le_bytes());
            }
            if let Err(refusal) = table(&bytes) {
                assert!(!refusal.message.is_empty());
            }
        }
    }
}

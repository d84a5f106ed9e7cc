//! Serialisation of a difference between two ensembles: a JSON header and raw numbers, which keep every bit.

use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

use super::{Difference, Verdict};

/// First bytes of the format; the last one is its version.
const MAGIC: &[u8] = b"lacuna difference of ensembles 1\n";

#[derive(Serialize, Deserialize)]
struct Header {
    outputs: usize,
    runs: usize,
    emulated: Vec<bool>,
    /// Size of the emulator in bytes.
    emulator: Option<usize>,
    verdicts: Vec<Verdict>,
}

fn damaged() -> Stop {
    Stop::new("what was learned of two ensembles is damaged")
        .help("remove it, so that it is learned again")
}

/// Two files as one: the length of the first (8 bytes, little-endian), the first, the second.
pub fn joined(first: &[u8], second: &[u8]) -> Vec<u8> {
    [&(first.len() as u64).to_le_bytes()[..], first, second].concat()
}

/// Splits the result of [`joined`] into the two files.
pub fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), Stop> {
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(damaged)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| damaged())?;
    rest.split_at_checked(length).ok_or_else(damaged)
}

impl Difference {
    /// Serialises the difference.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Stop> {
        let header = Header {
            outputs: self.scale.len(),
            runs: self.residuals.rows(),
            emulated: self.emulated.clone(),
            emulator: self.emulator.as_ref().map(Vec::len),
            verdicts: self.verdicts.clone(),
        };
        let header = serde_json::to_vec(&header)
            .map_err(|error| Stop::new(format!("two ensembles cannot be saved: {error}")))?;
        let numbers =
            [&self.scale, &self.offset, &self.relative, self.residuals.as_slice()].concat();
        let numbers: Vec<u8> = numbers.iter().flat_map(|x: &f64| x.to_le_bytes()).collect();
        let rest =
            joined(&header, &[self.emulator.as_deref().unwrap_or_default(), &numbers].concat());
        Ok([MAGIC, &rest].concat())
    }

    /// Restores a difference from [`Difference::to_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Stop> {
        let (header, rest) = split(bytes.strip_prefix(MAGIC).ok_or_else(damaged)?)?;
        let header: Header = serde_json::from_slice(header).map_err(|_| damaged())?;
        let (emulator, numbers) =
            rest.split_at_checked(header.emulator.unwrap_or(0)).ok_or_else(damaged)?;
        let (numbers, tail) = numbers.as_chunks::<8>();
        let mut scale: Vec<f64> = numbers.iter().map(|x| f64::from_le_bytes(*x)).collect();
        let wanted = header.runs.checked_add(3).and_then(|rows| rows.checked_mul(header.outputs));
        let whole = tail.is_empty() && header.emulated.len() == header.outputs;
        if !whole || wanted != Some(scale.len()) {
            return Err(damaged());
        }
        let residuals = scale.split_off(3 * header.outputs);
        let relative = scale.split_off(2 * header.outputs);
        let offset = scale.split_off(header.outputs);
        Ok(Self {
            residuals: Matrix::from_vec(header.runs, header.outputs, residuals),
            scale,
            offset,
            relative,
            emulated: header.emulated,
            emulator: header.emulator.map(|_| emulator.to_vec()),
            verdicts: header.verdicts,
        })
    }
}

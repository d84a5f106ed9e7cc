//! File format of a JSON header and raw numbers, which preserves every bit.

use lacuna::run::Stop;
use serde::Serialize;
use serde::de::DeserializeOwned;

const NAME: &str = "polynomial_chaos";

/// Like [`write_as`], for this plugin.
pub(super) fn write(header: &impl Serialize, numbers: &[&[f64]]) -> Result<Vec<u8>, Stop> {
    write_as(NAME, header, numbers)
}

/// Like [`read_as`], for this plugin.
pub(super) fn read<H: DeserializeOwned>(bytes: &[u8]) -> Result<(H, Numbers<'_>), Stop> {
    read_as(NAME, bytes)
}

/// Like [`damaged_as`], for this plugin.
pub(super) fn damaged() -> Stop {
    damaged_as(NAME)
}

/// Returns the first bytes of a plugin's file; the digit is the version of its layout.
fn magic(plugin: &str) -> Vec<u8> {
    format!("lacuna {plugin} 2\n").into_bytes()
}

/// Writes the magic, the length of the header (8 bytes, little-endian), the header, and the numbers (little-endian).
pub(in crate::surrogates) fn write_as(
    plugin: &str,
    header: &impl Serialize,
    numbers: &[&[f64]],
) -> Result<Vec<u8>, Stop> {
    let header = serde_json::to_vec(header)
        .map_err(|error| Stop::new(format!("the surrogate cannot be saved: {error}")))?;
    let mut bytes = magic(plugin);
    bytes.extend((header.len() as u64).to_le_bytes());
    bytes.extend(header);
    bytes.reserve_exact(8 * numbers.iter().map(|part| part.len()).sum::<usize>());
    for x in numbers.iter().copied().flatten() {
        bytes.extend_from_slice(&x.to_le_bytes());
    }
    Ok(bytes)
}

/// Numbers of a file that are still to be read.
pub(in crate::surrogates) struct Numbers<'a>(&'a [[u8; 8]]);

impl Numbers<'_> {
    /// Returns how many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns the next numbers; fewer if there are no more.
    pub fn next(&mut self, count: usize) -> Vec<f64> {
        let (next, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        next.iter().map(|x| f64::from_le_bytes(*x)).collect()
    }
}

/// Reads the header and the numbers of a file that [`write_as`] wrote; fails if it is damaged or from another
/// version.
pub(in crate::surrogates) fn read_as<'a, H: DeserializeOwned>(
    plugin: &str,
    bytes: &'a [u8],
) -> Result<(H, Numbers<'a>), Stop> {
    let damaged = || damaged_as(plugin);
    let rest = bytes.strip_prefix(&magic(plugin)[..]).ok_or_else(|| {
        Stop::new(format!(
            "the saved surrogate is not a `{plugin}` surrogate of this program version"
        ))
        .help("remove it, so that it is fitted again")
    })?;
    let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(damaged)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| damaged())?;
    let (header, numbers) = rest.split_at_checked(length).ok_or_else(damaged)?;
    let header = serde_json::from_slice(header).map_err(|_| damaged())?;
    let (numbers, tail) = numbers.as_chunks::<8>();
    if !tail.is_empty() {
        return Err(damaged());
    }
    Ok((header, Numbers(numbers)))
}

/// Returns the error for a damaged file.
pub(in crate::surrogates) fn damaged_as(plugin: &str) -> Stop {
    Stop::new(format!("the saved `{plugin}` surrogate is damaged"))
        .help("remove it, so that it is fitted again")
}

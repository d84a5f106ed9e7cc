//! Files of the measurements: `measurements.json`, and for many values the numbers themselves in `measurements.bin`.

use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::Path;

use lacuna::data::{Layout, Measurements, Observations, Replicate};
use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

use super::Measured;
use crate::stage::screen::{self, FlaggedCurve};

/// Text of the measurements: all of them, or what is no number of many.
const TEXT: &str = "measurements.json";

/// Numbers of many measurements, of eight bytes each (little-endian): replicate by replicate its values and then, if they
/// are stated, its standard deviations.
const NUMBERS: &str = "measurements.bin";

/// Number of values from which on they are written as numbers instead of text.
const MANY: usize = 1_000_000;

/// Number that stands for a value that was not measured: a NaN that no computation returns.
const MISSING: u64 = 0x7ff8_4c61_6375_6e61;

/// Everything of many measurements except their numbers.
#[derive(Serialize, Deserialize)]
struct Outline {
    blocks: Vec<Block>,
    flagged: Vec<FlaggedCurve>,
    /// Curves that the study adds to the data of each block.
    added: Vec<Vec<Replicate>>,
}

#[derive(Serialize, Deserialize)]
struct Block {
    layout: Layout,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    covariance: Option<Matrix>,
    replicates: Vec<String>,
    /// Indices of the replicates that state their noise.
    stated: Vec<usize>,
}

/// Writes the measurements and returns the names of the files.
pub(super) fn save(folder: &Path, measured: Option<&Measured>) -> Result<Vec<String>, Stop> {
    save_from(MANY, folder, measured)
}

/// Like [`save`], as numbers from this number of values on.
fn save_from(many: usize, folder: &Path, measured: Option<&Measured>) -> Result<Vec<String>, Stop> {
    let text = folder.join(TEXT);
    let Some(measured) = measured.filter(|measured| measured.read.count() >= many) else {
        files::write_json(&text, &measured)?;
        return Ok(vec![TEXT.to_owned()]);
    };
    let of_likelihood = measured.used.blocks.iter().zip(&measured.likelihood.blocks);
    let outline = Outline {
        blocks: measured.read.blocks.iter().map(Block::of).collect(),
        flagged: measured.flagged.clone(),
        added: of_likelihood
            .map(|(used, all)| all.replicates[used.replicates.len()..].to_vec())
            .collect(),
    };
    files::write_json(&text, &outline)?;
    files::write_atomic_with(&folder.join(NUMBERS), |file| {
        for replicate in measured.read.blocks.iter().flat_map(|block| &block.replicates) {
            for value in &replicate.values {
                let bits = value.map_or(MISSING, f64::to_bits);
                file.write_all(&bits.to_le_bytes())?;
            }
            for sd in replicate.sd.iter().flatten() {
                file.write_all(&sd.to_le_bytes())?;
            }
        }
        Ok(())
    })?;
    Ok(vec![TEXT.to_owned(), NUMBERS.to_owned()])
}

/// Reads the measurements.
pub(super) fn load(folder: &Path) -> Result<Option<Measured>, Stop> {
    let path = folder.join(NUMBERS);
    if !path.is_file() {
        return files::read_json(&folder.join(TEXT));
    }
    let outline: Outline = files::read_json(&folder.join(TEXT))?;
    let failed = |error: std::io::Error| files::cannot_read(&path, &error);
    let mut file = BufReader::new(File::open(&path).map_err(failed)?);
    let blocks: std::io::Result<_> =
        outline.blocks.into_iter().map(|block| block.with_numbers(&mut file)).collect();
    let read = Observations { blocks: blocks.map_err(failed)? };
    let used = read.map(|data| screen::without(data, &outline.flagged));
    let mut likelihood = used.clone();
    for (block, added) in likelihood.blocks.iter_mut().zip(outline.added) {
        if !added.is_empty() {
            block.replicates.extend(added);
        }
    }
    Ok(Some(Measured { read, used, likelihood, flagged: outline.flagged }))
}

impl Block {
    fn of(data: &Measurements) -> Self {
        let replicates = || data.replicates.iter().enumerate();
        Self {
            layout: data.layout.clone(),
            covariance: data.covariance.clone(),
            replicates: replicates().map(|(_, r)| r.name.clone()).collect(),
            stated: replicates().filter(|(_, r)| r.sd.is_some()).map(|(i, _)| i).collect(),
        }
    }

    fn with_numbers(self, file: &mut impl Read) -> std::io::Result<Measurements> {
        let outputs = self.layout.len();
        let mut stated = self.stated.into_iter().peekable();
        let mut bytes = vec![0; 8 * outputs];
        let mut replicates = Vec::with_capacity(self.replicates.len());
        for (i, name) in self.replicates.into_iter().enumerate() {
            let values = numbers(file, &mut bytes)?;
            let values = values.map(|x| (x.to_bits() != MISSING).then_some(x)).collect();
            let mut replicate = Replicate::new(name, values);
            if stated.next_if_eq(&i).is_some() {
                replicate.sd = Some(numbers(file, &mut bytes)?.collect());
            }
            replicates.push(replicate);
        }
        let data = Measurements::new(self.layout, replicates);
        Ok(Measurements { covariance: self.covariance, ..data })
    }
}

/// Numbers that fill the bytes.
fn numbers<'a>(
    file: &mut impl Read,
    bytes: &'a mut [u8],
) -> std::io::Result<impl Iterator<Item = f64> + 'a> {
    file.read_exact(bytes)?;
    let (words, _) = bytes.as_chunks::<8>();
    Ok(words.iter().map(|word| f64::from_le_bytes(*word)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::file::{AddedCurve, MeasurementKeys};
    use lacuna::data::{Axis, Unit};

    /// Measurements with missing values, stated noise, a faulty curve that is left out, and an added curve.
    fn measured(stated: bool) -> Measured {
        let grid: Vec<f64> = (0..6).map(f64::from).collect();
        let layout = Layout {
            name: "y".into(),
            unit: Unit::dimensionless(),
            axes: vec![Axis::grid("time", grid, Unit::parse("s").unwrap())],
        };
        let value = |r: usize, i: usize| {
            let y = 0.1 * r as f64 + (i as f64).sin() + if r == 5 { 100.0 * i as f64 } else { 0.0 };
            (r * i != 6).then_some(y)
        };
        let replicate = |r: usize| Replicate {
            sd: (stated && r != 2).then(|| vec![0.1 * (r + 1) as f64; 6]),
            ..Replicate::new(format!("p{r}"), (0..6).map(|i| value(r, i)).collect())
        };
        let data = Measurements::new(layout, (0..8).map(replicate).collect());
        let keys = MeasurementKeys {
            screen: Some(toml::from_str("threshold = 10.0\nleave_out = true").unwrap()),
            added_curves: vec![AddedCurve::Mean],
            ..MeasurementKeys::default()
        };
        screen::screened(&keys, Observations { blocks: vec![data.clone(), data] })
    }

    /// Both forms of the files hold the same measurements; those of the numbers share what is equal.
    #[test]
    fn many_values_are_read_as_they_were_written() {
        for stated in [false, true] {
            let measured = measured(stated);
            assert!(measured.flagged.iter().any(|flagged| flagged.left_out));
            for (many, files) in [(1000, 1), (10, 2)] {
                let folder = tempfile::tempdir().unwrap();
                let saved = save_from(many, folder.path(), Some(&measured)).unwrap();
                assert_eq!(saved.len(), files);
                assert_eq!(load(folder.path()).unwrap().as_ref(), Some(&measured));
            }
        }
        let folder = tempfile::tempdir().unwrap();
        save(folder.path(), None).unwrap();
        assert_eq!(load(folder.path()).unwrap(), None);
    }

    #[test]
    fn a_short_file_of_numbers_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        save_from(10, folder.path(), Some(&measured(false))).unwrap();
        let path = folder.path().join(NUMBERS);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
        assert!(load(folder.path()).unwrap_err().message.contains(NUMBERS));
    }
}

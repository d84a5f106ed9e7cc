//! `matlab`: records in MAT-files.

mod level5;
#[cfg(test)]
mod tests;
mod version73;

use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Layout, Measurements};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::{Contents, EnsembleSource, GridSource, MeasurementSource, ReadError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::records::store::{self, Store};
use super::records::{Records, reads_records};

/// Reads MATLAB's MAT-files, of level 5 (versions 5 to 7.2, compressed or not) and of version 7.3 (HDF5): measured
/// records, and one response per file.
///
/// Variables are named as in MATLAB: `strain`, a field `pulse.strain`, a field of an element of a structure array
/// `pulse(3).strain`, an element of a cell array `records(3)`. Each replicate is a variable, an element or a file:
///
/// ```toml
/// [measurements]
/// use = "matlab"
/// path = "shots.mat"
/// dataset = "pulse({replicate}).strain"
/// axes = ["time", "sensor"]
/// time = "pulse({replicate}).t"
/// time_unit = "ms"
/// ```
///
/// or all are columns of one matrix, here of 5000 samples and 12 pulses:
///
/// ```toml
/// [measurements]
/// use = "matlab"
/// path = "shots.mat"
/// dataset = "strain_{sensor}"
/// axes = ["time", "replicate"]
/// step = 1e-6
/// resample = "filtered"
/// ```
///
/// `axes` are rows, columns and pages, in this order. NaN is a missing value. Text, sparse and complex matrices and
/// objects are not numbers that this reader takes; of a file of version 7.3 it takes matrices and fields of a single
/// structure. Files of level 4 are refused.
///
/// Source: *MAT-File Format*, The `MathWorks` (R2023b).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Matlab(Records);

/// First bytes of a file of version 7.3, before the HDF5 file at byte 512.
const VERSION_73: &[u8] = b"MATLAB 7.3 MAT-file";

fn open(path: &Path) -> Result<Box<dyn Store>, ReadError> {
    let mut head = [0; VERSION_73.len()];
    let read =
        std::fs::File::open(path).and_then(|mut file| std::io::Read::read(&mut file, &mut head));
    read.map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
    if head == VERSION_73 {
        return Ok(Box::new(version73::File::open(path)?));
    }
    Ok(Box::new(level5::File::open(path)?))
}

fn recognises(_: &Path, head: &[u8]) -> bool {
    head.starts_with(VERSION_73) || level5::recognised(head)
}

reads_records!(Matlab, open, recognises, false);
lacuna::register!(Reader, "matlab", Matlab, aliases: ["mat", "octave"]);

//! `hdf5`: records in HDF5 files.

pub(crate) mod file;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Layout, Measurements};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::{Contents, EnsembleSource, GridSource, MeasurementSource, ReadError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::records::store::{self, Store};
use super::records::{Records, reads_records};
use super::sierra::signal::is_exodus;

/// Reads HDF5 files whose datasets and dimensions the options name: measured records, and one response per file.
///
/// Each replicate is a dataset or several, as in a file with one group per pulse:
///
/// ```toml
/// [measurements]
/// use = "hdf5"
/// path = "shots.h5"
/// dataset = "pulse_{replicate}/strain_{sensor}"
/// time = "pulse_{replicate}/time"
/// ```
///
/// or all are stacked in one array, here of 12 pulses, 3 sensors and 5000 samples a microsecond apart:
///
/// ```toml
/// [measurements]
/// use = "hdf5"
/// path = "shots.h5"
/// dataset = "strain"
/// axes = ["replicate", "sensor", "time"]
/// labels = { sensor = ["B", "C", "reference"] }
/// step = 1
/// time_unit = "us"
/// resample = "filtered"
/// trigger = { channel = "beam", level = 0.5 }
/// ```
///
/// NaN is a missing value, as are numbers equal to the attribute `_FillValue`; `scale_factor` and `add_offset` are
/// applied. Datasets with enumerations, references or compounds are not numbers.
///
/// Files of netCDF-4 with named dimensions are read by `netcdf` without these options.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Hdf5(Records);

fn open(path: &Path) -> Result<Box<dyn Store>, ReadError> {
    Ok(Box::new(file::File::open(path)?))
}

/// An HDF5 file that is not netCDF-4 or Exodus, which have readers of their own.
fn recognises(path: &Path, head: &[u8]) -> bool {
    is_exodus(head)
        && !head.starts_with(b"CDF")
        && file::File::open(path).is_ok_and(|file| !file.is_netcdf())
}

reads_records!(Hdf5, open, recognises, false);
lacuna::register!(Reader, "hdf5", Hdf5, aliases: ["h5", "h5py"]);

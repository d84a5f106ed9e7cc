//! `tdms`: records in TDMS files of National Instruments.

mod bytes;
mod channels;
mod file;
mod kind;
mod metadata;
mod pieces;
mod scale;
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

/// Reads TDMS files of National Instruments (`LabVIEW`, `DIAdem`), version 2.0: measured records, and one response per
/// file.
///
/// A dataset is a channel, by the names of group and channel: `Pulse 1/B` is channel `B` of group `Pulse 1`. Each
/// replicate is a group, a channel or a file:
///
/// ```toml
/// [measurements]
/// use = "tdms"
/// path = "shots.tdms"
/// dataset = "Pulse {replicate}/{sensor}"
/// resample = "filtered"
/// trigger = { channel = "Pulse {replicate}/beam", level = 0.5 }
/// ```
///
/// The times of the samples are those of the waveform, the properties `wf_start_offset` and `wf_increment`, unless the
/// options name a channel of times with `time`, or an interval with `step`; the moment `wf_start_time` is not used. A
/// channel of time stamps is in seconds since its first. The unit is the property `unit_string`.
///
/// Scales that the file states for stored numbers, `NI_Scale…`, are applied if they are linear or polynomial; NaN is a
/// missing value. Channels of text, of complex numbers, of numbers of extended precision, with other scales, and the raw
/// data of `DAQmx` are not numbers that this reader takes. A segment that its writer did not finish is read as far as it
/// goes; a file that was cut off otherwise is refused.
///
/// Source: National Instruments, *TDMS File Format Internal Structure* (2023).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Tdms(Records);

fn open(path: &Path) -> Result<Box<dyn Store>, ReadError> {
    Ok(Box::new(file::File::open(path)?))
}

fn recognises(_: &Path, head: &[u8]) -> bool {
    head.starts_with(metadata::TAG) || head.starts_with(metadata::INDEX_TAG)
}

reads_records!(Tdms, open, recognises, true);
lacuna::register!(Reader, "tdms", Tdms, aliases: ["labview", "diadem"]);

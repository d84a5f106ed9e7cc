//! The containers of Exodus II: netCDF classic, 64-bit offset, 64-bit data, and netCDF-4.
//!
//! The three classic containers are read by `netcdf-reader`. A netCDF-4 file is HDF5 and is read by dataset name: the
//! Exodus library creates it with `NC_NODIMSCALE_ATTACH`, so that the `DIMENSION_LIST` attributes that tie variables
//! to dimensions are missing and a netCDF reader must refuse it. Exodus fixes the order of every variable's
//! dimensions, so that names suffice.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use hdf5_reader::{BytesStorage, Dataset, Datatype, FileStorage, Hdf5File, OpenOptions, Storage};
use lacuna::plugin::reader::ReadError;
use netcdf_reader::{NcFile, NcFormat, NcSliceInfo, NcSliceInfoElem};

/// Largest ratio of data to file size. Deflate cannot shrink data by more than 1032, so that a larger extent means a
/// damaged file and must not be allocated.
const LARGEST_EXPANSION: u64 = 1100;
/// Minimum of the read limit in bytes, which leaves room for unwritten (fill value) chunks of small files.
const SMALLEST_LIMIT: u64 = 64 << 20;

/// An open container: variables by name, with attributes, for any file format.
pub struct Container {
    path: PathBuf,
    bytes: u64,
    shapes: BTreeMap<String, Vec<usize>>,
    source: Source,
}

enum Source {
    Classic(Box<NcFile>),
    Hdf5 { file: Box<Hdf5File>, datasets: BTreeMap<String, Dataset> },
}

/// Selection along one dimension of a variable.
#[derive(Debug, Clone, Copy)]
pub enum Pick {
    /// All indices.
    All,
    /// One index, counted from 0.
    At(usize),
}

impl Container {
    /// Opens a file. Data are read on demand by position and not mapped: a file that another process shortens
    /// meanwhile gives an error and not a signal.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let storage = FileStorage::open(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        Self::from_storage(path, Arc::new(storage))
    }

    /// Opens the bytes of a file; `path` is only used in messages.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, ReadError> {
        Self::from_storage(path, Arc::new(BytesStorage::new(bytes)))
    }

    fn from_storage(path: &Path, storage: Arc<dyn Storage>) -> Result<Self, ReadError> {
        let bytes = storage.len();
        let head = storage
            .read_range(0, bytes.min(8) as usize)
            .map_err(|e| ReadError::new(path, format!("cannot be read: {e}")))?;
        if head.is_empty() {
            return Err(ReadError::new(path, "is empty"));
        }
        let opened = if head.starts_with(b"\x89HDF\r\n\x1a\n") {
            open_hdf5(storage)
        } else if head.starts_with(b"CDF") {
            open_classic(storage)
        } else {
            let start: String = head.iter().map(|b| b.escape_ascii().to_string()).collect();
            Err(format!(
                "is not a netCDF file: it starts with `{start}`, not with `CDF` or `\\x89HDF`"
            ))
        };
        let (shapes, source) = opened.map_err(|message| ReadError::new(path, message))?;
        Ok(Self { path: path.to_owned(), bytes, shapes, source })
    }

    /// Returns the path of the file as given by the user.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the name of the container format.
    pub fn format(&self) -> &'static str {
        match &self.source {
            Source::Hdf5 { .. } => "netCDF-4",
            Source::Classic(file) => match file.format() {
                NcFormat::Classic => "netCDF classic (CDF-1)",
                NcFormat::Offset64 => "netCDF 64-bit offset (CDF-2)",
                NcFormat::Cdf5 => "netCDF 64-bit data (CDF-5)",
                NcFormat::Nc4 | NcFormat::Nc4Classic => "netCDF-4",
            },
        }
    }

    /// Returns the lengths of a variable's dimensions; `None` if the file has no such variable.
    pub fn shape(&self, name: &str) -> Option<&[usize]> {
        self.shapes.get(name).map(Vec::as_slice)
    }

    /// Returns the length of a dimension. In netCDF-4 files a dimension is a dataset of that length.
    pub fn dimension(&self, name: &str) -> Option<usize> {
        match &self.source {
            Source::Classic(file) => file.dimension(name).ok().map(|d| d.size as usize),
            Source::Hdf5 { .. } => self.shape(name)?.first().copied(),
        }
    }

    /// Fails for a number of entries that a file of this size cannot hold, before memory is allocated for it.
    pub fn check_count(&self, what: &str, count: usize) -> Result<(), ReadError> {
        let limit = match self.source {
            Source::Classic(_) => self.bytes,
            Source::Hdf5 { .. } => read_limit(self.bytes) / 8,
        };
        if count as u64 <= limit {
            return Ok(());
        }
        let text = format!("is damaged: {count} {what} do not fit in {} bytes", self.bytes);
        Err(ReadError::new(&self.path, text))
    }

    /// Reads all numbers of a variable, last dimension fastest.
    pub fn reals(&self, name: &str) -> Result<Vec<f64>, ReadError> {
        let all = vec![Pick::All; self.shape(name).map_or(0, <[usize]>::len)];
        self.part(name, &all)
    }

    /// Reads a part of a variable, last dimension fastest.
    pub fn part(&self, name: &str, picks: &[Pick]) -> Result<Vec<f64>, ReadError> {
        let numbers = match &self.source {
            Source::Classic(file) => file
                .read_variable_slice_as_f64(name, &classic_slice(picks))
                .map(|array| array.iter().copied().collect())
                .map_err(|e| e.to_string()),
            Source::Hdf5 { datasets, .. } => match datasets.get(name) {
                Some(dataset) => hdf5_reals(dataset, picks),
                None => Err("no such variable".to_owned()),
            },
        };
        numbers.map_err(|e| self.damaged(name, &e))
    }

    /// Reads all whole numbers of a variable. They are exact up to 2^53, far above any mesh size.
    pub fn integers(&self, name: &str) -> Result<Vec<i64>, ReadError> {
        Ok(self.reals(name)?.into_iter().map(|x| x as i64).collect())
    }

    /// Reads the strings of a character variable, whose last dimension is the length of a string.
    pub fn texts(&self, name: &str) -> Result<Vec<String>, ReadError> {
        let strings = match &self.source {
            Source::Classic(file) => file.read_variable_as_strings(name).map_err(|e| e.to_string()),
            Source::Hdf5 { datasets, .. } => match datasets.get(name) {
                Some(dataset) => hdf5_texts(dataset),
                None => Err("no such variable".to_owned()),
            },
        };
        let strings = strings.map_err(|e| self.damaged(name, &e))?;
        Ok(strings.iter().map(|text| unpadded(text)).collect())
    }

    /// Returns a text attribute of a variable.
    pub fn variable_text(&self, variable: &str, attribute: &str) -> Option<String> {
        match &self.source {
            Source::Classic(file) => {
                file.variable(variable).ok()?.attribute(attribute)?.value.as_string()
            }
            Source::Hdf5 { datasets, .. } => {
                datasets.get(variable)?.attribute(attribute).ok()?.read_string().ok()
            }
        }
        .map(|text| unpadded(&text))
    }

    /// Returns a text attribute of the file.
    pub fn text(&self, attribute: &str) -> Option<String> {
        match &self.source {
            Source::Classic(file) => file.global_attribute(attribute).ok()?.value.as_string(),
            Source::Hdf5 { file, .. } => {
                file.root_group().ok()?.attribute(attribute).ok()?.read_string().ok()
            }
        }
        .map(|text| unpadded(&text))
    }

    /// Returns a numeric attribute of the file.
    pub fn real(&self, attribute: &str) -> Option<f64> {
        match &self.source {
            Source::Classic(file) => file.global_attribute(attribute).ok()?.value.as_f64(),
            Source::Hdf5 { file, .. } => {
                file.root_group().ok()?.attribute(attribute).ok()?.read_as_f64().ok()
            }
        }
    }

    fn damaged(&self, name: &str, reason: &str) -> ReadError {
        ReadError::new(&self.path, format!("variable `{name}` cannot be read: {reason}"))
    }
}

type Opened = (BTreeMap<String, Vec<usize>>, Source);

fn open_classic(storage: Arc<dyn Storage>) -> Result<Opened, String> {
    let broken = |e: netcdf_reader::Error| format!("is truncated or damaged: {e}");
    let file = NcFile::from_storage(storage).map_err(broken)?;
    let shapes = file
        .variables()
        .map_err(broken)?
        .iter()
        .map(|v| (v.name().to_owned(), v.shape().iter().map(|&n| n as usize).collect()))
        .collect();
    Ok((shapes, Source::Classic(Box::new(file))))
}

fn open_hdf5(storage: Arc<dyn Storage>) -> Result<Opened, String> {
    let broken = |e: hdf5_reader::error::Error| format!("is truncated or damaged: {e}");
    let limit = read_limit(storage.len()) as usize;
    let options = OpenOptions::default().with_max_read_bytes(limit);
    let file = Hdf5File::from_storage_with_options(storage, options).map_err(broken)?;
    let mut datasets = BTreeMap::new();
    let mut shapes = BTreeMap::new();
    for dataset in file.root_group().and_then(|root| root.datasets()).map_err(broken)? {
        let name = dataset.name().trim_start_matches('/').to_owned();
        shapes.insert(name.clone(), dataset.shape().iter().map(|&n| n as usize).collect());
        datasets.insert(name, dataset);
    }
    Ok((shapes, Source::Hdf5 { file: Box::new(file), datasets }))
}

/// Returns the maximum number of bytes that one read of a file of this length may allocate.
pub(crate) fn read_limit(bytes: u64) -> u64 {
    bytes.saturating_mul(LARGEST_EXPANSION).max(SMALLEST_LIMIT)
}

fn classic_slice(picks: &[Pick]) -> NcSliceInfo {
    let selections = picks
        .iter()
        .map(|pick| match *pick {
            Pick::All => NcSliceInfoElem::Slice { start: 0, end: u64::MAX, step: 1 },
            Pick::At(i) => NcSliceInfoElem::Index(i as u64),
        })
        .collect();
    NcSliceInfo { selections }
}

/// Reads a part of a dataset as numbers, last dimension fastest.
pub(crate) fn hdf5_reals(dataset: &Dataset, picks: &[Pick]) -> Result<Vec<f64>, String> {
    fn read<T: hdf5_reader::H5Type + Copy>(
        dataset: &Dataset,
        picks: &[Pick],
        widen: impl Fn(T) -> f64,
    ) -> Result<Vec<f64>, String> {
        let selections = picks
            .iter()
            .map(|pick| match *pick {
                Pick::All => hdf5_reader::SliceInfoElem::Slice { start: 0, end: u64::MAX, step: 1 },
                Pick::At(i) => hdf5_reader::SliceInfoElem::Index(i as u64),
            })
            .collect();
        let array = dataset
            .read_slice::<T>(&hdf5_reader::SliceInfo { selections })
            .map_err(|e| e.to_string())?;
        Ok(array.iter().map(|&x| widen(x)).collect())
    }
    match dataset.dtype() {
        Datatype::FloatingPoint { size: 4, .. } => read::<f32>(dataset, picks, f64::from),
        Datatype::FloatingPoint { size: 8, .. } => read::<f64>(dataset, picks, |x| x),
        Datatype::FixedPoint { size: 1, signed: true, .. } => read::<i8>(dataset, picks, f64::from),
        Datatype::FixedPoint { size: 1, signed: false, .. } => {
            read::<u8>(dataset, picks, f64::from)
        }
        Datatype::FixedPoint { size: 2, signed: true, .. } => {
            read::<i16>(dataset, picks, f64::from)
        }
        Datatype::FixedPoint { size: 2, signed: false, .. } => {
            read::<u16>(dataset, picks, f64::from)
        }
        Datatype::FixedPoint { size: 4, signed: true, .. } => {
            read::<i32>(dataset, picks, f64::from)
        }
        Datatype::FixedPoint { size: 4, signed: false, .. } => {
            read::<u32>(dataset, picks, f64::from)
        }
        Datatype::FixedPoint { size: 8, signed: true, .. } => {
            read::<i64>(dataset, picks, |x| x as f64)
        }
        Datatype::FixedPoint { size: 8, signed: false, .. } => {
            read::<u64>(dataset, picks, |x| x as f64)
        }
        _ => Err("does not hold numbers".to_owned()),
    }
}

fn hdf5_texts(dataset: &Dataset) -> Result<Vec<String>, String> {
    if !matches!(dataset.dtype(), Datatype::String { .. }) {
        return Err("does not hold characters".to_owned());
    }
    let length = dataset.shape().last().copied().unwrap_or(1) as usize;
    let bytes = dataset.read_raw_bytes().map_err(|e| e.to_string())?;
    Ok(bytes
        .chunks(length.max(1))
        .map(|chunk| String::from_utf8_lossy(chunk).into_owned())
        .collect())
}

/// Removes the padding of an Exodus string: NUL or blanks, with arbitrary bytes after the first NUL.
fn unpadded(text: &str) -> String {
    text.split('\0').next().unwrap_or_default().trim().to_owned()
}

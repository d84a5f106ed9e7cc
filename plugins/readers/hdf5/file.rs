//! An HDF5 file as named arrays.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, FileStorage, Hdf5File, OpenOptions, Storage};
use lacuna::plugin::reader::ReadError;

use crate::readers::records::store::{Array, Store};
use crate::readers::sierra::container::{Pick, hdf5_reals, read_limit};

/// Deepest nesting of groups. Groups may contain each other in a circle.
const DEEPEST: usize = 12;
/// Largest number of datasets that are listed.
const MOST: usize = 100_000;

/// An open file.
pub(crate) struct File {
    path: PathBuf,
    content: Hdf5File,
    names: Vec<String>,
}

impl File {
    /// Opens a file and lists its datasets, in the groups' order of names.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let broken = |e: hdf5_reader::error::Error| {
            ReadError::new(path, format!("is not a complete HDF5 file: {e}"))
        };
        let storage = FileStorage::open(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        let limit = read_limit(storage.len()) as usize;
        let options = OpenOptions::default().with_max_read_bytes(limit);
        let file =
            Hdf5File::from_storage_with_options(Arc::new(storage), options).map_err(broken)?;
        let mut names = Vec::new();
        file.root_group()
            .and_then(|root| list(&root, "", &mut Vec::new(), &mut names))
            .map_err(broken)?;
        Ok(Self { path: path.to_owned(), content: file, names })
    }

    /// Returns true for a file of the netCDF library, of which dimensions are datasets.
    pub fn is_netcdf(&self) -> bool {
        let Ok(root) = self.content.root_group() else { return false };
        let scale = |name: &String| {
            let class = self.content.dataset(name).ok().and_then(|d| d.attribute("CLASS").ok());
            class
                .and_then(|c| c.read_string().ok())
                .is_some_and(|c| c.starts_with("DIMENSION_SCALE"))
        };
        root.attribute("_NCProperties").is_ok() || self.names.iter().any(scale)
    }

    fn dataset(&self, name: &str) -> Result<Dataset, ReadError> {
        self.content.dataset(name).map_err(|e| self.broken(name, &e.to_string()))
    }

    fn broken(&self, name: &str, reason: &str) -> ReadError {
        ReadError::new(&self.path, format!("cannot be read: {reason}"))
            .at(format!("dataset `{name}`"))
    }
}

fn list(
    group: &Group,
    prefix: &str,
    above: &mut Vec<u64>,
    names: &mut Vec<String>,
) -> Result<(), hdf5_reader::error::Error> {
    if above.len() >= DEEPEST || above.contains(&group.address()) {
        return Ok(());
    }
    let (mut groups, mut datasets) = group.member_names()?;
    groups.sort();
    datasets.sort();
    names.extend(
        datasets.iter().take(MOST.saturating_sub(names.len())).map(|d| format!("{prefix}{d}")),
    );
    above.push(group.address());
    for name in groups {
        list(&group.group(&name)?, &format!("{prefix}{name}/"), above, names)?;
    }
    above.pop();
    Ok(())
}

fn text(dataset: &Dataset, attribute: &str) -> Option<String> {
    let text = dataset.attribute(attribute).ok()?.read_string().ok()?;
    Some(text.trim_matches(['\0', ' ']).to_owned()).filter(|text| !text.is_empty())
}

fn number(dataset: &Dataset, attribute: &str) -> Option<f64> {
    dataset.attribute(attribute).ok()?.read_as_f64().ok()
}

impl Store for File {
    fn path(&self) -> &Path {
        &self.path
    }

    fn format(&self) -> String {
        "HDF5".to_owned()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn array(&self, name: &str) -> Result<Array, ReadError> {
        let dataset = self.dataset(name)?;
        let shape: Vec<usize> = dataset.shape().iter().map(|&n| n as usize).collect();
        let mut values = hdf5_reals(&dataset, &vec![Pick::All; shape.len()])
            .map_err(|reason| self.broken(name, &reason))?;
        if let Some(fill) = number(&dataset, "_FillValue") {
            values.iter_mut().filter(|x| **x == fill).for_each(|x| *x = f64::NAN);
        }
        let scale = number(&dataset, "scale_factor").unwrap_or(1.0);
        let offset = number(&dataset, "add_offset").unwrap_or(0.0);
        if scale != 1.0 || offset != 0.0 {
            for x in &mut values {
                *x = scale * *x + offset;
            }
        }
        let unit = text(&dataset, "units").or_else(|| text(&dataset, "unit"));
        Ok(Array { shape, values, unit })
    }
}

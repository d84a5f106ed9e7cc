//! Named arrays in a NetCDF file: the format in which stages store numbers, readable by every netCDF tool.

mod classic;

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::matrix::Matrix;
use lacuna::plugin::model::Response;
use lacuna::run::{Stop, files};
use netcdf_reader::{NcFile, NcType, NcVariable};
use netcdf_writer::{NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions};

/// An array with named dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct Array<'a> {
    /// Name of the array.
    pub name: String,
    /// Name and length of each dimension, slowest-varying first.
    pub dimensions: Vec<(String, usize)>,
    /// Values, row-major.
    pub values: Cow<'a, [f64]>,
    /// Unit, if there is one.
    pub unit: Option<String>,
}

impl<'a> Array<'a> {
    /// An array of a matrix's numbers, with names for its rows and columns.
    pub fn matrix(name: &str, rows: &str, columns: &str, matrix: &'a Matrix) -> Self {
        let dimensions =
            vec![(rows.to_owned(), matrix.rows()), (columns.to_owned(), matrix.columns())];
        Self { name: name.to_owned(), dimensions, values: matrix.as_slice().into(), unit: None }
    }

    /// The values alone.
    pub fn into_values(self) -> Vec<f64> {
        self.values.into_owned()
    }

    /// The array as a matrix: the first dimension becomes the rows, all others together the columns.
    pub fn into_matrix(self) -> Matrix {
        let rows = self.dimensions.first().map_or(1, |d| d.1);
        let columns = self.dimensions.iter().skip(1).map(|d| d.1).product();
        Matrix::from_vec(rows, columns, self.values.into_owned())
    }
}

/// Number of values from which on a file is written without the library, which copies them several times.
const LARGE: usize = 1 << 20;

/// Writes arrays and text attributes as a classic netCDF file with 64-bit offsets.
pub fn write(path: &Path, attributes: &[(&str, String)], arrays: &[Array<'_>]) -> Result<(), Stop> {
    files::write_atomic_with(path, filling(path, attributes, arrays)?)
}

/// Like [`write()`], to a path that a user names: see [`files::write_named`].
pub fn write_named(
    path: &Path,
    attributes: &[(&str, String)],
    arrays: &[Array<'_>],
) -> Result<(), Stop> {
    files::write_named_with(path, filling(path, attributes, arrays)?)
}

/// Function that fills the file.
fn filling(
    path: &Path,
    attributes: &[(&str, String)],
    arrays: &[Array<'_>],
) -> Result<impl FnOnce(&mut BufWriter<File>) -> io::Result<()>, Stop> {
    let count: usize = arrays.iter().map(|array| array.values.len()).sum();
    let bytes = if count >= LARGE && classic::is_possible(arrays) {
        None
    } else {
        let bytes = by_library(attributes, arrays)
            .map_err(|error| Stop::new(format!("cannot write {}: {error}", path.display())))?;
        Some(bytes)
    };
    Ok(move |file: &mut BufWriter<File>| match bytes {
        Some(bytes) => file.write_all(&bytes),
        None => classic::write(file, attributes, arrays),
    })
}

/// The bytes of the file, by the library.
fn by_library(
    attributes: &[(&str, String)],
    arrays: &[Array<'_>],
) -> Result<Vec<u8>, netcdf_writer::Error> {
    let mut builder = NcFileBuilder::new();
    for (name, value) in attributes {
        builder.add_attribute(*name, NcAttrValue::Chars(value.clone()))?;
    }
    let mut known: Vec<(String, netcdf_writer::DimensionId)> = Vec::new();
    for array in arrays {
        let mut dimensions = Vec::new();
        for (name, length) in &array.dimensions {
            let id = if let Some((_, id)) = known.iter().find(|(known, _)| known == name) {
                *id
            } else {
                let id = builder.add_dimension(name, *length as u64)?;
                known.push((name.clone(), id));
                id
            };
            dimensions.push(id);
        }
        let variable = builder.add_variable::<f64>(&array.name, &dimensions)?;
        if let Some(unit) = &array.unit {
            builder.add_variable_attribute(variable, "units", NcAttrValue::Chars(unit.clone()))?;
        }
        builder.write_variable(variable, &array.values)?;
    }
    let options = NcWriteOptions { format: NcWriteFormat::Offset64 };
    Ok(builder.to_vec(options)?.1)
}

/// Reads one array of a file that [`fn@write`] wrote.
pub fn read(path: &Path, name: &str) -> Result<Array<'static>, Stop> {
    let missing = || failed(path, &format!("no variable `{name}`"));
    read_some(path, name)?.ok_or_else(missing)
}

/// Reads the array with this name; `None` if the file has none.
pub fn read_some(path: &Path, name: &str) -> Result<Option<Array<'static>>, Stop> {
    let fail = |error: String| failed(path, &error);
    let file = NcFile::open(path).map_err(|error| fail(error.to_string()))?;
    let variables = file.variables().map_err(|error| fail(error.to_string()))?;
    let Some(variable) = variables.iter().find(|v| v.name() == name) else { return Ok(None) };
    let dimensions: Vec<(String, usize)> =
        variable.dimensions().iter().map(|d| (d.name.clone(), d.size as usize)).collect();
    let values = numbers(path, &file, variable).map_err(fail)?;
    let unit = variable.attribute("units").and_then(|attribute| attribute.value.as_string());
    Ok(Some(Array { name: name.to_owned(), dimensions, values, unit }))
}

/// The numbers of a variable; those of double precision are read in place. A damaged header can state any size: the
/// memory is that of numbers for which the file has room.
fn numbers(
    path: &Path,
    file: &NcFile,
    variable: &NcVariable,
) -> Result<Cow<'static, [f64]>, String> {
    let name = variable.name();
    if *variable.dtype() != NcType::Double || file.as_classic().is_none() {
        let values = file.read_variable_as_f64(name).map_err(|error| error.to_string())?;
        return Ok(values.iter().copied().collect::<Vec<f64>>().into());
    }
    let room = std::fs::metadata(path).map_err(|error| error.to_string())?.len() / 8;
    let mut sizes = variable.dimensions().iter().map(|d| d.size);
    let count = sizes
        .try_fold(1_u64, u64::checked_mul)
        .filter(|count| *count <= room)
        .and_then(|count| usize::try_from(count).ok())
        .ok_or_else(|| format!("`{name}` is larger than the file"))?;
    let mut values = vec![0.0; count];
    file.read_variable_into(name, &mut values).map_err(|error| error.to_string())?;
    Ok(values.into())
}

fn failed(path: &Path, error: &str) -> Stop {
    Stop::new(format!("cannot read {}: {error}", path.display()))
}

/// Writes the response of one run as `NAME.nc`: a variable with the response's name on the axes of the layout, with
/// their grids as coordinate variables and their labels as attributes (`sensor_labels` for an axis `sensor`). Returns the
/// file name.
pub fn write_response(
    folder: &Path,
    run: &str,
    layout: &Layout,
    response: &Response,
) -> Result<String, Stop> {
    let mut arrays = Vec::new();
    let mut attributes = vec![("title", run.to_owned())];
    let labels: Vec<(String, String)> = layout.axes.iter().filter_map(axis_labels).collect();
    for (name, text) in &labels {
        attributes.push((name, text.clone()));
    }
    for axis in &layout.axes {
        if let Coordinates::Grid { values, unit } = &axis.coordinates {
            arrays.push(Array {
                name: axis.name.clone(),
                dimensions: vec![(axis.name.clone(), values.len())],
                values: values.into(),
                unit: Some(unit.to_string()),
            });
        }
    }
    arrays.push(Array {
        name: layout.name.clone(),
        dimensions: layout.axes.iter().map(|a| (a.name.clone(), a.len())).collect(),
        values: (&response.values).into(),
        unit: Some(layout.unit.to_string()),
    });
    let file = format!("{run}.nc");
    write(&folder.join(&file), &attributes, &arrays)?;
    Ok(file)
}

/// Attribute with the labels of an axis: separated by blanks, or as a list in JSON if a label has a blank itself.
fn axis_labels(axis: &Axis) -> Option<(String, String)> {
    match &axis.coordinates {
        Coordinates::Labels(labels) => {
            let one_word = |label: &String| {
                !label.is_empty() && !label.starts_with('[') && !label.contains(char::is_whitespace)
            };
            let text = if labels.iter().all(one_word) {
                labels.join(" ")
            } else {
                serde_json::json!(labels).to_string()
            };
            Some((format!("{}_labels", axis.name), text))
        }
        Coordinates::Grid { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.nc");
        let matrix = Matrix::from_fn(3, 2, |i, j| (i as f64 + 0.1) / (j as f64 + 0.7));
        let stored = [Array::matrix("points", "run", "parameter", &matrix)];
        write(&path, &[("title", "a test".to_owned())], &stored).unwrap();
        assert_eq!(read(&path, "points").unwrap().into_matrix(), matrix);
        let missing = read(&path, "draws").unwrap_err();
        assert!(missing.message.ends_with("no variable `draws`"), "{missing}");
    }

    #[test]
    fn large_arrays_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.nc");
        let matrix = Matrix::from_fn(LARGE / 1000 + 1, 1000, |i, j| (i * 1000 + j) as f64 / 7.0);
        let points = Matrix::from_fn(matrix.rows(), 2, |i, j| (i + j) as f64);
        let stored = [
            Array::matrix("points", "run", "parameter", &points),
            Array::matrix("responses", "run", "output", &matrix),
        ];
        write(&path, &[("title", "a test".to_owned())], &stored).unwrap();
        assert_eq!(read(&path, "points").unwrap().into_matrix(), points);
        assert_eq!(read(&path, "responses").unwrap().into_matrix(), matrix);
    }

    /// A header whose dimensions a flipped bit has changed, and a file that was cut off.
    #[test]
    fn a_size_that_the_file_does_not_have_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.nc");
        let matrix = Matrix::from_fn(3, 2, |i, j| (i + j) as f64);
        write(&path, &[], &[Array::matrix("points", "run", "parameter", &matrix)]).unwrap();
        let whole = std::fs::read(&path).unwrap();
        // Each dimension: the length of its name, the name, and its size.
        let run = whole.windows(4).position(|name| name == b"run\0").unwrap() + 4;
        for size in [7_u32, 1 << 20, u32::MAX] {
            let mut damaged = whole.clone();
            damaged[run..run + 4].copy_from_slice(&size.to_be_bytes());
            std::fs::write(&path, &damaged).unwrap();
            assert!(read(&path, "points").is_err(), "{size}");
        }
        std::fs::write(&path, &whole[..whole.len() - 8]).unwrap();
        assert!(read(&path, "points").is_err());
    }
}

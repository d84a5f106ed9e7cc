//! Variables of a netCDF file, mapped onto the axes of the response.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hdf5_reader::{FileStorage, Storage};
use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::plugin::reader::ReadError;
use lacuna_linalg::Matrix;
use netcdf_reader::{NcFile, NcOpenOptions, NcType, NcVariable};

use crate::discrepancies::common::squared;
use crate::readers::cells::{Places, grid_places};
use crate::readers::listed;
use crate::readers::noise::REPLICATE;
use crate::readers::sierra::container::read_limit;

/// An open netCDF file.
pub(super) struct File {
    pub(super) path: PathBuf,
    pub(super) file: NcFile,
}

impl File {
    /// Opens a file. Data are read by position, so that a file that shrinks gives an error.
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let storage = FileStorage::open(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        Self::from_storage(path, Arc::new(storage))
    }

    pub(super) fn from_storage(path: &Path, storage: Arc<dyn Storage>) -> Result<Self, ReadError> {
        let options = NcOpenOptions {
            max_read_bytes: read_limit(storage.len()) as usize,
            ..NcOpenOptions::default()
        };
        let file = NcFile::from_storage_with_options(storage, options)
            .map_err(|e| ReadError::new(path, format!("is not a complete netCDF file: {e}")))?;
        Ok(Self { path: path.to_owned(), file })
    }

    pub(super) fn complain(&self, text: impl Into<String>) -> ReadError {
        ReadError::new(&self.path, text)
    }

    pub(super) fn variables(&self) -> Result<&[NcVariable], ReadError> {
        self.file.variables().map_err(|e| self.complain(format!("is damaged: {e}")))
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.file.variable(name).is_ok()
    }

    fn variable(&self, name: &str) -> Result<&NcVariable, ReadError> {
        let variables = self.variables()?;
        variables.iter().find(|v| v.name() == name).ok_or_else(|| {
            let names: Vec<&str> = variables.iter().map(NcVariable::name).collect();
            self.complain(format!("has no variable `{name}`; it has {}", listed(&names)))
        })
    }

    /// Returns all numbers of a variable, missing ones as NaN, last dimension fastest.
    pub(super) fn numbers(&self, name: &str) -> Result<Vec<f64>, ReadError> {
        self.file
            .read_variable_unpacked_masked(name)
            .map(|array| array.iter().copied().collect())
            .map_err(|e| {
                self.complain(format!("cannot be read: {e}")).at(format!("variable `{name}`"))
            })
    }

    /// Returns the attribute `units` of a variable.
    pub(super) fn unit(&self, variable: &NcVariable) -> Result<Option<Unit>, ReadError> {
        let text = variable.attribute("units").and_then(|attribute| attribute.value.as_string());
        text.map(|text| Unit::parse(&text)).transpose().map_err(|e| {
            self.complain(e.to_string()).at(format!("units of variable `{}`", variable.name()))
        })
    }

    /// Returns the numbers of a variable in the unit `to`.
    fn converted(&self, name: &str, to: Option<&Unit>) -> Result<Vec<f64>, ReadError> {
        let mut numbers = self.numbers(name)?;
        if let (Some(from), Some(to)) = (self.unit(self.variable(name)?)?, to) {
            for x in &mut numbers {
                *x = from.convert(*x, to).ok_or_else(|| {
                    let text = format!("is in `{from}`, which does not convert to `{to}`");
                    self.complain(text).at(format!("variable `{name}`"))
                })?;
            }
        }
        Ok(numbers)
    }

    /// Reads a variable over a single dimension of this name and length.
    pub(super) fn along(
        &self,
        name: &str,
        dimension: &str,
        length: usize,
        unit: Option<&Unit>,
    ) -> Result<Vec<f64>, ReadError> {
        let found: Vec<&str> =
            self.variable(name)?.dimensions().iter().map(|d| d.name.as_str()).collect();
        let numbers = if found == [dimension] { self.converted(name, unit)? } else { Vec::new() };
        if numbers.len() != length {
            let text = format!("expected the dimension `{dimension}`, found {}", listed(&found));
            return Err(self.complain(text).at(format!("variable `{name}`")));
        }
        Ok(numbers)
    }

    /// Returns the names along a dimension: the texts or numbers of its coordinate variable, else 1, 2, 3, ...
    pub(super) fn names(&self, dimension: &str, count: usize) -> Result<Vec<String>, ReadError> {
        let names: Vec<String> = if !self.has(dimension) {
            (1..=count).map(|i| i.to_string()).collect()
        } else if let Some(texts) = self.texts(dimension)? {
            texts
        } else {
            self.numbers(dimension)?.iter().map(ToString::to_string).collect()
        };
        let mut sorted = names.clone();
        sorted.sort();
        sorted.dedup();
        if sorted.len() != count {
            let text = format!("expected {count} different names, found {}", sorted.len());
            return Err(self.complain(text).at(format!("variable `{dimension}`")));
        }
        Ok(names)
    }

    fn texts(&self, name: &str) -> Result<Option<Vec<String>>, ReadError> {
        if !matches!(self.variable(name)?.dtype(), NcType::Char | NcType::String) {
            return Ok(None);
        }
        let texts = self.file.read_variable_as_strings(name).map_err(|e| {
            self.complain(format!("cannot be read: {e}")).at(format!("variable `{name}`"))
        })?;
        Ok(Some(texts.iter().map(|text| text.trim().to_owned()).collect()))
    }

    /// Returns the responses in a variable, each on the layout: one per index of the dimension `outer`, or a single
    /// one.
    pub(super) fn responses(
        &self,
        name: &str,
        layout: &Layout,
        outer: Option<&str>,
    ) -> Result<Vec<Vec<f64>>, ReadError> {
        let dimensions = self.variable(name)?.dimensions();
        let found: Vec<&str> = dimensions.iter().map(|d| d.name.as_str()).collect();
        let expected: Vec<&str> =
            outer.into_iter().chain(layout.axes.iter().map(|axis| axis.name.as_str())).collect();
        if found.len() != expected.len() || !expected.iter().all(|name| found.contains(name)) {
            let text =
                format!("expected dimensions {}, found {}", listed(&expected), listed(&found));
            return Err(self.complain(text).at(format!("variable `{name}`")));
        }
        // The data are read first: the dimensions of a damaged file must not cause a large allocation.
        let numbers = self.converted(name, Some(&layout.unit))?;
        // Offset in the result for each index along each dimension.
        let mut count = 1;
        let mut offsets: Vec<Vec<usize>> = Vec::new();
        for dimension in dimensions {
            let length = dimension.size as usize;
            offsets.push(if let Some((position, axis)) = layout.axis(&dimension.name) {
                let stride: usize = layout.axes[position + 1..].iter().map(Axis::len).product();
                self.places(axis, length)?.into_iter().map(|i| i * stride).collect()
            } else {
                count = length;
                (0..length).map(|i| i * layout.len()).collect()
            });
        }
        let mut responses = vec![0.0; count * layout.len()];
        for (flat, y) in numbers.into_iter().enumerate() {
            let mut rest = flat;
            let mut target = 0;
            for offsets in offsets.iter().rev() {
                target += offsets[rest % offsets.len()];
                rest /= offsets.len();
            }
            responses[target] = y;
        }
        Ok(responses.chunks(layout.len().max(1)).map(<[f64]>::to_vec).collect())
    }

    /// Returns the responses of one scenario, one per index of `outer`: those of the variable, or, if it has a
    /// dimension `scenario`, those at its label.
    pub(super) fn of_scenario(
        &self,
        name: &str,
        layout: &Layout,
        outer: Option<&str>,
        scenario: Option<&str>,
    ) -> Result<Vec<Vec<f64>>, ReadError> {
        let divided = self.variable(name)?.dimensions().iter().any(|d| d.name == SCENARIO);
        let Some(scenario) = scenario.filter(|_| divided) else {
            return self.responses(name, layout, outer);
        };
        let labels = self.labels(&Axis::labels(SCENARIO, [""; 0]))?;
        let place = labels.iter().position(|label| label == scenario).ok_or_else(|| {
            let text = format!("has no scenario `{scenario}`; it has {}", listed(&labels));
            self.complain(text).at(format!("variable `{name}`"))
        })?;
        let mut all = layout.clone();
        all.axes.insert(0, Axis::labels(SCENARIO, labels));
        let length = layout.len();
        let own = place * length..(place + 1) * length;
        let responses = self.responses(name, &all, outer)?;
        Ok(responses.into_iter().map(|response| response[own.clone()].to_vec()).collect())
    }

    /// Returns measured curves, one per index of the dimension `replicate`; a single one if the variable has only the
    /// axes.
    pub(super) fn curves(
        &self,
        name: &str,
        layout: &Layout,
        scenario: Option<&str>,
    ) -> Result<Vec<Vec<f64>>, ReadError> {
        let dimensions = self.variable(name)?.dimensions();
        let has = |wanted: &str| dimensions.iter().any(|d| d.name == wanted);
        let axes = layout.axes.len() + usize::from(scenario.is_some() && has(SCENARIO));
        let outer = has(REPLICATE) || dimensions.len() > axes;
        self.of_scenario(name, layout, outer.then_some(REPLICATE), scenario)
    }

    /// Returns standard deviations in the unit of the layout.
    pub(super) fn widths(
        &self,
        name: &str,
        layout: &Layout,
        scenario: Option<&str>,
    ) -> Result<Vec<Vec<f64>>, ReadError> {
        let own = self.unit(self.variable(name)?)?;
        let own = own.unwrap_or_else(|| layout.unit.clone());
        let [one, zero] = [1.0, 0.0].map(|x| own.convert(x, &layout.unit));
        let (Some(one), Some(zero)) = (one, zero) else {
            let text = format!("is in `{own}`, which does not convert to `{}`", layout.unit);
            return Err(self.complain(text).at(format!("variable `{name}`")));
        };
        let curves = self.curves(name, &Layout { unit: own, ..layout.clone() }, scenario)?;
        let scaled = |curve: Vec<f64>| curve.into_iter().map(|x| x * (one - zero)).collect();
        Ok(curves.into_iter().map(scaled).collect())
    }

    /// Reads a square covariance variable in the squared unit of the layout and in its order.
    pub(super) fn square(&self, name: &str, layout: &Layout) -> Result<Matrix, ReadError> {
        let variable = self.variable(name)?;
        let sizes: Vec<usize> = variable.dimensions().iter().map(|d| d.size as usize).collect();
        let size = layout.len();
        if sizes != [size, size] {
            let text = format!("expected {size} x {size} numbers, found dimensions {sizes:?}");
            return Err(self.complain(text).at(format!("variable `{name}`")));
        }
        let mut numbers = self.numbers(name)?;
        if let Some(unit) = self.unit(variable)? {
            let squared = squared(&layout.unit).map_err(|e| self.complain(e.to_string()))?;
            let factor = unit.factor_to(&squared).ok_or_else(|| {
                let text = format!("is in `{unit}`, which does not convert to `{squared}`");
                self.complain(text).at(format!("variable `{name}`"))
            })?;
            for x in &mut numbers {
                *x *= factor;
            }
        }
        if let Some(x) = numbers.iter().find(|x| !x.is_finite()) {
            return Err(self.complain(format!("holds {x}")).at(format!("variable `{name}`")));
        }
        Ok(Matrix::from_vec(size, size, numbers))
    }

    /// Returns the numbers of a coordinate variable in `unit`, in increasing order.
    pub(super) fn grid(&self, name: &str, unit: &Unit) -> Result<Vec<f64>, ReadError> {
        let mut numbers = self.converted(name, Some(unit))?;
        if let Some(x) = numbers.iter().find(|x| !x.is_finite()) {
            return Err(self.complain(format!("holds {x}")).at(format!("variable `{name}`")));
        }
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        Ok(numbers)
    }

    /// Returns the index on the response's axis of each index of the file's dimension; fails unless all values of the
    /// axis are present.
    fn places(&self, axis: &Axis, length: usize) -> Result<Vec<usize>, ReadError> {
        let complain = |text: String| self.complain(text).at(format!("dimension `{}`", axis.name));
        let places = match &axis.coordinates {
            Coordinates::Labels(_) => {
                let places = Places::of(axis);
                let labels = self.labels(axis)?;
                labels.iter().map(|label| places.place(label, Some)).collect::<Result<Vec<_>, _>>()
            }
            Coordinates::Grid { .. } => {
                let variable = self.variable(&axis.name)?;
                let unit = self.unit(variable)?;
                grid_places(axis, &self.numbers(&axis.name)?, unit.as_ref())
            }
        };
        let places = places.map_err(complain)?;
        let mut sorted = places.clone();
        sorted.sort_unstable();
        sorted.dedup();
        if places.len() != length || sorted.len() != length || length != axis.len() {
            let missing = (0..axis.len()).find(|i| !sorted.contains(i));
            let missing =
                missing.map_or(String::new(), |i| format!("; `{}` is missing", axis.text(i)));
            let text = format!(
                "expected {} different places, found {} on {length}{missing}",
                axis.len(),
                sorted.len()
            );
            return Err(complain(text));
        }
        Ok(places)
    }

    fn labels(&self, axis: &Axis) -> Result<Vec<String>, ReadError> {
        if self.has(&axis.name)
            && let Some(texts) = self.texts(&axis.name)?
        {
            return Ok(texts);
        }
        let attribute = format!("{}_labels", axis.name);
        let text = self.file.global_attribute(&attribute).ok().and_then(|a| a.value.as_string());
        let text = text.ok_or_else(|| {
            let name = &axis.name;
            self.complain(format!(
                "has neither a text variable `{name}` nor an attribute `{attribute}`"
            ))
        })?;
        match serde_json::from_str(&text) {
            Ok(list) => Ok(list),
            Err(_) => Ok(text.split_whitespace().map(str::to_owned).collect()),
        }
    }
}

//! Groups, dimensions and variables of the file.

use std::io::{self, Write};

use lacuna::data::statistics::Kind;
use lacuna::data::{Coordinates, Layout};
use netcdf_writer::{
    DimensionId, Error, NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions, NcWriteType,
    VariableId,
};

/// A file under construction.
pub struct File {
    builder: NcFileBuilder,
}

impl File {
    /// An empty file with its global attributes.
    pub fn new(attributes: &[(&str, &str)]) -> Result<Self, Error> {
        let mut file = Self { builder: NcFileBuilder::new() };
        for (name, text) in attributes {
            file.builder.add_attribute(*name, NcAttrValue::Chars((*text).to_owned()))?;
        }
        Ok(file)
    }

    /// Writes the file.
    pub fn write(&self, to: impl Write) -> io::Result<()> {
        let options = NcWriteOptions { format: NcWriteFormat::Nc4 };
        match self.builder.write(to, options) {
            Ok(_) => Ok(()),
            Err(Error::Io(error)) => Err(error),
            Err(other) => Err(io::Error::other(other)),
        }
    }

    /// Sets an attribute of a group.
    pub fn describe(&mut self, group: &str, name: &str, value: NcAttrValue) -> Result<(), Error> {
        self.builder.add_group_attribute(group, name, value)
    }

    /// Adds a dimension with its coordinate variable of whole numbers.
    pub fn counted(
        &mut self,
        group: &str,
        name: &str,
        numbers: &[usize],
    ) -> Result<(DimensionId, VariableId), Error> {
        let path = format!("{group}/{name}");
        let dimension = self.builder.add_dimension_path(&path, numbers.len() as u64)?;
        let numbers: Vec<i64> = numbers.iter().map(|&n| n as i64).collect();
        Ok((dimension, self.variable(&path, &[dimension], &numbers)?))
    }

    /// Adds a variable of numbers.
    pub fn numbers(
        &mut self,
        path: &str,
        dimensions: &[DimensionId],
        values: &[f64],
        unit: Option<&str>,
    ) -> Result<VariableId, Error> {
        let variable = self.variable(path, dimensions, values)?;
        if let Some(unit) = unit {
            self.attribute(variable, "units", unit)?;
        }
        Ok(variable)
    }

    /// Adds a variable of the given kind: flags as bytes that xarray reads as booleans, counts as whole numbers.
    pub fn of_kind(
        &mut self,
        path: &str,
        dimensions: &[DimensionId],
        values: &[f64],
        kind: Kind,
    ) -> Result<(), Error> {
        match kind {
            Kind::Number => self.numbers(path, dimensions, values, None).map(|_| ()),
            Kind::Count => {
                let values: Vec<i64> = values.iter().map(|x| *x as i64).collect();
                self.variable(path, dimensions, &values).map(|_| ())
            }
            Kind::Flag => {
                let values: Vec<i8> = values.iter().map(|x| i8::from(*x != 0.0)).collect();
                let variable = self.variable(path, dimensions, &values)?;
                self.attribute(variable, "dtype", "bool")
            }
        }
    }

    fn variable<T: NcWriteType>(
        &mut self,
        path: &str,
        dimensions: &[DimensionId],
        values: &[T],
    ) -> Result<VariableId, Error> {
        let variable = self.builder.add_variable_path::<T>(path, dimensions)?;
        self.builder.write_variable(variable, values)?;
        Ok(variable)
    }

    /// Sets a text attribute of a variable.
    pub fn attribute(&mut self, variable: VariableId, name: &str, text: &str) -> Result<(), Error> {
        self.builder.add_variable_attribute(variable, name, NcAttrValue::Chars(text.to_owned()))
    }

    /// Adds a variable of texts.
    pub fn texts(
        &mut self,
        path: &str,
        dimension: DimensionId,
        texts: &[String],
    ) -> Result<(), Error> {
        let variable = self.builder.add_string_variable_path(path, &[dimension])?;
        self.builder.write_string_variable(variable, texts)
    }

    /// Adds a dimension whose coordinates are labels.
    pub fn labels(
        &mut self,
        group: &str,
        name: &str,
        labels: &[String],
    ) -> Result<DimensionId, Error> {
        let path = format!("{group}/{name}");
        let dimension = self.builder.add_dimension_path(&path, labels.len() as u64)?;
        self.texts(&path, dimension, labels)?;
        Ok(dimension)
    }

    /// Adds the axes of a block of scenarios as dimensions with coordinates.
    pub fn axes(
        &mut self,
        group: &str,
        layout: &Layout,
        suffix: &str,
    ) -> Result<Vec<DimensionId>, Error> {
        let mut dimensions = Vec::new();
        for axis in &layout.axes {
            dimensions.push(match &axis.coordinates {
                Coordinates::Labels(labels) => {
                    self.labels(group, &format!("{}{suffix}", axis.name), labels)?
                }
                Coordinates::Grid { values, unit } => {
                    let path = format!("{group}/{}{suffix}", axis.name);
                    let dimension = self.builder.add_dimension_path(&path, values.len() as u64)?;
                    self.numbers(&path, &[dimension], values, Some(&unit.to_string()))?;
                    dimension
                }
            });
        }
        Ok(dimensions)
    }
}

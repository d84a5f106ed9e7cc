//! Contents of a netCDF file.

use lacuna::data::Table;
use lacuna::data::table::Column;
use lacuna::plugin::reader::{Contents, ReadError, Variable};
use netcdf_reader::{NcFormat, NcType, NcVariable};

use super::array::File;
use crate::readers::contents::{MOST_SIGNAL_VALUES, fact, limits};

pub(super) fn contents(file: &File) -> Result<Contents, ReadError> {
    let format = match file.file.format() {
        NcFormat::Classic => "netCDF classic (CDF-1)",
        NcFormat::Offset64 => "netCDF 64-bit offset (CDF-2)",
        NcFormat::Cdf5 => "netCDF 64-bit data (CDF-5)",
        NcFormat::Nc4 | NcFormat::Nc4Classic => "netCDF-4",
    };
    let attributes = file.file.global_attributes().unwrap_or_default();
    let mut facts: Vec<(String, String)> =
        attributes.iter().filter_map(|a| Some(fact(&a.name, a.value.as_string()?))).collect();
    for dimension in file.file.dimensions().unwrap_or_default() {
        facts.push(fact(&format!("dimension {}", dimension.name), dimension.size));
    }
    let mut variables = Vec::new();
    for variable in file.variables()? {
        if matches!(variable.dtype(), NcType::Char | NcType::String) {
            facts.push(fact(&format!("texts {}", variable.name()), shape(variable)));
        } else {
            variables.push(described(file, variable)?);
        }
    }
    Ok(Contents { format: format.to_owned(), facts, variables })
}

fn shape(variable: &NcVariable) -> String {
    let lengths: Vec<String> = variable.shape().iter().map(ToString::to_string).collect();
    lengths.join(" x ")
}

fn described(file: &File, variable: &NcVariable) -> Result<Variable, ReadError> {
    let values = file.numbers(variable.name())?;
    let (range, not_finite) = limits(&values);
    let axes: Vec<(String, usize)> =
        variable.dimensions().iter().map(|d| (d.name.clone(), d.size as usize)).collect();
    let signals = if values.len() <= MOST_SIGNAL_VALUES {
        signals(file, variable, &axes, &values)
    } else {
        Table::default()
    };
    Ok(Variable {
        name: variable.name().to_owned(),
        on: "file".to_owned(),
        axes,
        // A unit unknown to the engine does not prevent the description.
        unit: file.unit(variable).ok().flatten(),
        range,
        not_finite,
        signals,
    })
}

/// Returns the coordinate of the last dimension, and one column for each combination of the others.
fn signals(file: &File, variable: &NcVariable, axes: &[(String, usize)], values: &[f64]) -> Table {
    let column = |name: String, values: Vec<f64>| Column { name, unit: None, values };
    let Some(((along, length), outer)) = axes.split_last() else {
        return Table { columns: vec![column(variable.name().to_owned(), values.to_vec())] };
    };
    let mut columns = Vec::new();
    if along != variable.name() {
        let coordinate = file.has(along).then(|| file.numbers(along).ok()).flatten();
        let coordinate = coordinate.filter(|x| x.len() == *length);
        let coordinate = coordinate.unwrap_or_else(|| (1..=*length).map(|i| i as f64).collect());
        columns.push(column(along.clone(), coordinate));
    }
    for (i, values) in values.chunks((*length).max(1)).enumerate() {
        let mut rest = i;
        let mut place: Vec<String> = Vec::new();
        for (name, length) in outer.iter().rev() {
            place.insert(0, format!(" {name} {}", rest % length + 1));
            rest /= length;
        }
        columns.push(column(format!("{}{}", variable.name(), place.concat()), values.to_vec()));
    }
    Table { columns }
}

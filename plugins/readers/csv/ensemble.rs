//! The responses of all runs in one table, long or wide.

use std::collections::BTreeMap;

use lacuna::data::{Coordinates, Layout};
use lacuna::plugin::reader::ReadError;

use crate::readers::cells::{LongColumns, on_axis};
use crate::readers::runs::Run;
use crate::readers::sheet::{Record, Sheet};

type Values = Vec<Option<f64>>;

/// The values of each run, in the order of the runs; `None` where the table has none.
pub(super) fn responses(
    sheet: &Sheet,
    runs: &[Run],
    layout: &Layout,
) -> Result<Vec<Values>, ReadError> {
    let names = Names::new(sheet, runs)?;
    let long = !layout.axes.is_empty() && layout.axes.iter().any(|a| sheet.find(&a.name).is_some());
    if long { long_table(sheet, &names, layout) } else { wide_table(sheet, &names, layout) }
}

struct Names<'a> {
    column: usize,
    positions: BTreeMap<&'a str, usize>,
}

impl<'a> Names<'a> {
    fn new(sheet: &Sheet, runs: &'a [Run]) -> Result<Self, ReadError> {
        let positions = runs.iter().enumerate().map(|(i, run)| (run.name.as_str(), i)).collect();
        Ok(Self { column: sheet.column("run")?, positions })
    }

    fn position(&self, sheet: &Sheet, record: &Record) -> Result<usize, ReadError> {
        let name = record.cells[self.column].as_str();
        self.positions.get(name).copied().ok_or_else(|| {
            let text = format!("run `{name}` is not in the table of parameters");
            sheet.complain(record, self.column, text)
        })
    }
}

fn long_table(sheet: &Sheet, names: &Names<'_>, layout: &Layout) -> Result<Vec<Values>, ReadError> {
    let columns = LongColumns::find(sheet, layout)?;
    let mut values = vec![vec![None; layout.len()]; names.positions.len()];
    let mut lines = vec![vec![0; layout.len()]; names.positions.len()];
    for record in &sheet.records {
        let run = names.position(sheet, record)?;
        let place = columns.place(sheet, record)?;
        let first = lines[run][place];
        if first > 0 {
            let text = format!(
                "a second value of run `{}` for {}; the first is in line {first}",
                record.cells[names.column],
                layout.describe(place)
            );
            return Err(sheet.complain(record, columns.value, text));
        }
        lines[run][place] = record.line;
        values[run][place] = columns.number(sheet, record)?;
    }
    Ok(values)
}

fn wide_table(sheet: &Sheet, names: &Names<'_>, layout: &Layout) -> Result<Vec<Values>, ReadError> {
    let mut columns = Vec::with_capacity(layout.len());
    let mut headed: Vec<Option<usize>> = vec![None; layout.len()];
    for column in (0..sheet.headings.len()).filter(|&c| c != names.column) {
        let at = |text: String| {
            ReadError::new(&sheet.path, text).at(format!(
                "line {}, column {}",
                sheet.heading_line,
                column + 1
            ))
        };
        let heading = &sheet.headings[column].name;
        let place = headed_place(layout, heading).map_err(|text| {
            at(text).help("a wide table has the column `run` and one for each value of the response, headed by its place")
        })?;
        if let Some(other) = headed[place].replace(column) {
            let text = format!("`{heading}` means the same value as column {}", other + 1);
            return Err(at(text));
        }
        columns.push((column, place, sheet.conversion(column, &layout.unit)?));
    }
    let mut values = vec![vec![None; layout.len()]; names.positions.len()];
    let mut lines = vec![0; names.positions.len()];
    for record in &sheet.records {
        let run = names.position(sheet, record)?;
        if lines[run] > 0 {
            let name = &record.cells[names.column];
            let text = format!("a second row of run `{name}`; the first is line {}", lines[run]);
            return Err(sheet.complain(record, names.column, text));
        }
        lines[run] = record.line;
        for (column, place, conversion) in &columns {
            values[run][*place] = sheet.number(record, *column)?.and_then(|x| conversion.apply(x));
        }
    }
    Ok(values)
}

/// The value that the heading of a wide table means: `B 1e-5`, or `B:1e-5`.
fn headed_place(layout: &Layout, heading: &str) -> Result<usize, String> {
    if layout.axes.is_empty() {
        let expected = &layout.name;
        return if heading == expected {
            Ok(0)
        } else {
            Err(format!("expected the column `{expected}`, found `{heading}`"))
        };
    }
    let parts: Vec<&str> = match layout.axes.len() {
        // A single axis takes the heading whole: labels may contain blanks.
        1 => vec![heading],
        _ => heading.split([' ', ':', ';', '|', '@']).filter(|part| !part.is_empty()).collect(),
    };
    if parts.len() != layout.axes.len() {
        let axes: Vec<String> = layout.axes.iter().map(example).collect();
        return Err(format!("expected a heading like `{}`, found `{heading}`", axes.join(" ")));
    }
    let places = layout.axes.iter().zip(parts).map(|(axis, part)| on_axis(axis, part, Some));
    Ok(layout.index(&places.collect::<Result<Vec<_>, _>>()?))
}

fn example(axis: &lacuna::data::Axis) -> String {
    match &axis.coordinates {
        _ if axis.is_empty() => axis.name.clone(),
        Coordinates::Labels(labels) => labels[0].clone(),
        Coordinates::Grid { values, .. } => format!("{:e}", values[0]),
    }
}

//! Replicated measurements in a long table.

use std::collections::BTreeMap;

use lacuna::data::{Condition, Layout, Measurements, Replicate, Scenario};
use lacuna::plugin::reader::ReadError;

use crate::readers::cells::LongColumns;
use crate::readers::sheet::{Record, Sheet};

/// A replicate while its rows come in, with the line of each value.
struct Rows {
    replicate: Replicate,
    lines: Vec<usize>,
}

/// Reads the table: one replicate for each pair of `replicate` and conditions' name.
pub(super) fn measurements(
    sheet: &Sheet,
    layout: &Layout,
    scenario: &[String],
    ignore: &[String],
) -> Result<Measurements, ReadError> {
    let columns = LongColumns::find(sheet, layout)?;
    let name = sheet.column("replicate")?;
    let conditions = Conditions::find(sheet, scenario)?;
    reject_unknown(sheet, ignore, |c| columns.has(c) || c == name || conditions.has(c))?;
    let mut order: BTreeMap<(&str, String), usize> = BTreeMap::new();
    let mut found: Vec<Rows> = Vec::new();
    for record in &sheet.records {
        let place = columns.place(sheet, record)?;
        let scenario = conditions.read(sheet, record)?;
        let replicate = record.cells[name].as_str();
        let key = (replicate, scenario.name.clone());
        let number = *order.entry(key).or_insert_with(|| {
            let values = vec![None; layout.len()];
            let name = replicate.to_owned();
            let replicate = Replicate { name, scenario: scenario.clone(), values };
            found.push(Rows { replicate, lines: vec![0; layout.len()] });
            found.len() - 1
        });
        let rows = &mut found[number];
        if rows.replicate.scenario != scenario {
            let text = format!("replicate `{replicate}` changes its conditions");
            return Err(sheet.complain(record, name, text));
        }
        if rows.lines[place] > 0 {
            let text = format!(
                "a second value of replicate `{replicate}` for {}; the first is in line {}",
                layout.describe(place),
                rows.lines[place]
            );
            return Err(sheet.complain(record, columns.value, text));
        }
        rows.lines[place] = record.line;
        rows.replicate.values[place] = measured(sheet, record, &columns)?;
    }
    reject_absent(sheet, layout, &found)?;
    let replicates = found.into_iter().map(|rows| rows.replicate).collect();
    Ok(Measurements { layout: layout.clone(), replicates })
}

fn measured(
    sheet: &Sheet,
    record: &Record,
    columns: &LongColumns<'_>,
) -> Result<Option<f64>, ReadError> {
    let value = columns.number(sheet, record)?;
    if value.is_some_and(|y| !y.is_finite()) {
        let cell = &record.cells[columns.value];
        let text = format!("expected a finite number or a blank, found `{cell}`");
        return Err(sheet.complain(record, columns.value, text));
    }
    Ok(value)
}

/// The columns that say under which conditions a replicate was taken.
struct Conditions {
    name: Option<usize>,
    values: Vec<usize>,
}

impl Conditions {
    fn find(sheet: &Sheet, names: &[String]) -> Result<Self, ReadError> {
        let values = names.iter().map(|name| sheet.column(name)).collect::<Result<_, _>>()?;
        Ok(Self { name: sheet.find("scenario"), values })
    }

    fn has(&self, column: usize) -> bool {
        self.name == Some(column) || self.values.contains(&column)
    }

    fn read(&self, sheet: &Sheet, record: &Record) -> Result<Scenario, ReadError> {
        let name = self.name.map_or(String::new(), |column| record.cells[column].clone());
        let values = self.values.iter().map(|&column| {
            let value = sheet.number(record, column)?.ok_or_else(|| {
                let cell = &record.cells[column];
                sheet.complain(record, column, format!("expected a number, found `{cell}`"))
            })?;
            let name = sheet.headings[column].name.clone();
            Ok(Condition { name, value, unit: None })
        });
        let values = values.collect::<Result<_, ReadError>>()?;
        Ok(Scenario { name, values, functions: Vec::new() })
    }
}

/// A column that nothing reads may hold a condition: replicates of different conditions must not
/// silently become one.
fn reject_unknown(
    sheet: &Sheet,
    ignore: &[String],
    known: impl Fn(usize) -> bool,
) -> Result<(), ReadError> {
    let unknown =
        (0..sheet.headings.len()).find(|&c| !known(c) && !ignore.contains(&sheet.headings[c].name));
    let Some(column) = unknown else { return Ok(()) };
    let text = format!("column `{}` has no meaning here", sheet.headings[column].name);
    Err(ReadError::new(&sheet.path, text)
        .at(format!("line {}, column {}", sheet.heading_line, column + 1))
        .help("list it under `scenario` if it is a condition, else under `ignore`"))
}

/// Every sensor and every time of the response has to appear in some row, be it without a value.
fn reject_absent(sheet: &Sheet, layout: &Layout, found: &[Rows]) -> Result<(), ReadError> {
    let mut seen: Vec<Vec<bool>> = layout.axes.iter().map(|a| vec![false; a.len()]).collect();
    for flat in 0..layout.len() {
        if found.iter().any(|rows| rows.lines[flat] > 0) {
            for (axis, i) in layout.place(flat).into_iter().enumerate() {
                seen[axis][i] = true;
            }
        }
    }
    for (axis, seen) in layout.axes.iter().zip(seen) {
        if let Some(i) = seen.iter().position(|seen| !seen) {
            let text = format!("has no row for {} `{}`", axis.name, axis.text(i));
            return Err(ReadError::new(&sheet.path, text).help(
                "a value that was not measured is a row with a blank cell, or a shorter axis",
            ));
        }
    }
    Ok(())
}

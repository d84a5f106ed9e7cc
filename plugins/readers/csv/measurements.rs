//! Replicated measurements in a long table.

use std::collections::BTreeMap;

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Layout, Measurements, Replicate, Unit};
use lacuna::plugin::reader::ReadError;

use crate::readers::cells::LongColumns;
use crate::readers::sheet::{Record, Sheet};

/// A replicate while its rows come in, with the line of each value.
struct Rows {
    replicate: Replicate,
    lines: Vec<usize>,
}

/// Reads the table: one replicate for each name in the column `replicate`.
pub(super) fn measurements(
    sheet: &Sheet,
    layout: &Layout,
    ignore: &[String],
) -> Result<Measurements, ReadError> {
    let columns = LongColumns::find(sheet, layout)?;
    let name = sheet.column("replicate")?;
    reject_unknown(sheet, ignore, |c| columns.has(c) || c == name)?;
    let mut order: BTreeMap<&str, usize> = BTreeMap::new();
    let mut found: Vec<Rows> = Vec::new();
    for record in &sheet.records {
        let place = columns.place(sheet, record)?;
        let replicate = record.cells[name].as_str();
        let number = *order.entry(replicate).or_insert_with(|| {
            let values = vec![None; layout.len()];
            let replicate = Replicate { name: replicate.to_owned(), values };
            found.push(Rows { replicate, lines: vec![0; layout.len()] });
            found.len() - 1
        });
        let rows = &mut found[number];
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

/// The numbers of an axis that appear in the table, increasing.
pub(super) fn grid(sheet: &Sheet, axis: &str, unit: &Unit) -> Result<Vec<f64>, ReadError> {
    let column = sheet.column(axis)?;
    let conversion = sheet.conversion(column, unit)?;
    let mut numbers = Vec::with_capacity(sheet.records.len());
    for record in &sheet.records {
        let x = sheet.number(record, column)?.and_then(|x| conversion.apply(x));
        let x = x.filter(|x| x.is_finite()).ok_or_else(|| {
            let cell = &record.cells[column];
            sheet.complain(record, column, format!("expected a finite number, found `{cell}`"))
        })?;
        numbers.push(x);
    }
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    Ok(numbers)
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

/// A column that nothing reads may hold a condition: replicates of different conditions must not
/// silently become one.
fn reject_unknown(
    sheet: &Sheet,
    ignore: &[String],
    known: impl Fn(usize) -> bool,
) -> Result<(), ReadError> {
    let unknown = (0..sheet.headings.len()).find(|&c| {
        !known(c) && sheet.headings[c].name != SCENARIO && !ignore.contains(&sheet.headings[c].name)
    });
    let Some(column) = unknown else { return Ok(()) };
    let text = format!("column `{}` has no meaning here", sheet.headings[column].name);
    Err(ReadError::new(&sheet.path, text)
        .at(format!("line {}, column {}", sheet.heading_line, column + 1))
        .help("list it under `ignore` if it means nothing, or make it a scenario if it is a condition"))
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

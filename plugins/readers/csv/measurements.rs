//! Replicated measurements in a long table.

use std::collections::BTreeMap;

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Layout, Measurements, Replicate, Unit};
use lacuna::plugin::reader::ReadError;

use crate::readers::cells::LongColumns;
use crate::readers::faults::Faults;
use crate::readers::noise::{MASK, REPLICATE, SIGMA, left_out};
use crate::readers::sheet::{Conversion, Record, Sheet};

/// A replicate as its rows are read, with the line of each value.
struct Rows {
    replicate: Replicate,
    lines: Vec<usize>,
}

/// Columns of a table.
struct Columns<'a> {
    places: LongColumns<'a>,
    replicate: Option<usize>,
    sigma: Option<(usize, Conversion)>,
    mask: Option<usize>,
}

/// One row: replicate, place, value and standard deviation.
struct Row<'a> {
    replicate: &'a str,
    place: usize,
    value: Option<f64>,
    sd: f64,
}

/// Name of the only replicate of a table without a column `replicate`.
const ONLY: &str = "1";

/// Reads the table: one replicate for each name in the column `replicate`, or a single one without that column.
pub(super) fn measurements(
    (sheet, mut faults): (Sheet, Faults),
    layout: &Layout,
    ignore: &[String],
) -> Result<Measurements, ReadError> {
    let sheet = &sheet;
    let columns = match Columns::find(sheet, layout, ignore) {
        Ok(columns) => columns,
        Err(error) => {
            faults.note(sheet.heading_line, error);
            return faults.or(Measurements::new(layout.clone(), Vec::new()));
        }
    };
    let mut order: BTreeMap<&str, usize> = BTreeMap::new();
    let mut found: Vec<Rows> = Vec::new();
    for record in &sheet.records {
        let Some(row) = faults.take(record.line, columns.row(sheet, record)) else { continue };
        let number = *order.entry(row.replicate).or_insert_with(|| {
            let mut replicate = Replicate::new(row.replicate, vec![None; layout.len()]);
            replicate.sd = columns.sigma.is_some().then(|| vec![0.0; layout.len()]);
            found.push(Rows { replicate, lines: vec![0; layout.len()] });
            found.len() - 1
        });
        let rows = &mut found[number];
        if rows.lines[row.place] > 0 {
            let first = rows.lines[row.place];
            faults.note(record.line, columns.twice(sheet, record, layout, &row, first));
            continue;
        }
        rows.lines[row.place] = record.line;
        rows.replicate.values[row.place] = row.value;
        if let (Some(sd), Some(_)) = (&mut rows.replicate.sd, row.value) {
            sd[row.place] = row.sd;
        }
    }
    if faults.is_empty() {
        reject_absent(sheet, layout, &found, &mut faults);
    }
    let replicates = found.into_iter().map(|rows| rows.replicate).collect();
    faults.or(Measurements::new(layout.clone(), replicates))
}

impl<'a> Columns<'a> {
    fn find(sheet: &Sheet, layout: &'a Layout, ignore: &[String]) -> Result<Self, ReadError> {
        let known = |name: &str| sheet.find(name).filter(|_| !ignore.iter().any(|i| i == name));
        let places = LongColumns::find(sheet, layout);
        let of_places = places.as_ref().ok();
        // The response itself may have one of these names.
        let known = |name: &str| known(name).filter(|c| of_places.is_none_or(|p| !p.has(*c)));
        let sigma = known(SIGMA)
            .map(|column| {
                let own = sheet.conversion(column, &layout.unit)?;
                // A standard deviation without a unit of its own is in the unit of the values.
                let of_values = of_places.filter(|_| !own.is_stated()).map(LongColumns::conversion);
                Ok((column, of_values.cloned().unwrap_or(own)))
            })
            .transpose();
        let (replicate, mask) = (known(REPLICATE), known(MASK));
        let unknown = of_places.map_or(Ok(()), |places| {
            let own = [replicate, mask, known(SIGMA)];
            reject_unknown(sheet, ignore, |c| places.has(c) || own.contains(&Some(c)))
        });
        match (places, sigma, unknown) {
            (Ok(places), Ok(sigma), Ok(())) => Ok(Self { places, replicate, sigma, mask }),
            (places, sigma, unknown) => {
                let all = [places.err(), sigma.err(), unknown.err()].into_iter().flatten();
                Err(ReadError::of_all(all)
                    .unwrap_or_else(|| ReadError::new(&sheet.path, "cannot be read")))
            }
        }
    }

    fn row<'r>(&self, sheet: &Sheet, record: &'r Record) -> Result<Row<'r>, ReadError> {
        let mut faults = Faults::default();
        let replicate = self.replicate.map_or(ONLY, |column| &record.cells[column]);
        if let (true, Some(column)) = (replicate.is_empty(), self.replicate) {
            let text = "expected the name of a replicate, found a blank";
            faults.note(1, sheet.complain(record, column, text));
        }
        let place = faults.take(1, self.places.place(sheet, record));
        let value = faults.take(1, measured(sheet, record, &self.places)).flatten();
        let mask = self.mask.map(|column| left_out(sheet, record, column)).transpose();
        let masked = faults.take(1, mask).flatten().unwrap_or(false);
        let value = value.filter(|_| !masked);
        let sd = match (&self.sigma, value) {
            (Some(sigma), Some(_)) => faults.take(1, stated(sheet, record, sigma)),
            _ => Some(0.0),
        };
        let (place, sd) = (place.unwrap_or_default(), sd.unwrap_or_default());
        faults.or(Row { replicate, place, value, sd })
    }

    fn twice(
        &self,
        sheet: &Sheet,
        record: &Record,
        layout: &Layout,
        row: &Row<'_>,
        first: usize,
    ) -> ReadError {
        let place = layout.describe(row.place);
        let of = match self.replicate {
            Some(_) => format!(" of replicate `{}`", row.replicate),
            None => String::new(),
        };
        let text = format!("a second value{of} for {place}; the first is in line {first}");
        let error = sheet.complain(record, self.places.value, text);
        match self.replicate {
            Some(_) => error,
            None => error.help("a column `replicate` tells repeated measurements apart"),
        }
    }
}

/// Returns the numbers of an axis that appear in the table, in increasing order and in `unit`.
pub(super) fn grid(
    (sheet, mut faults): (Sheet, Faults),
    axis: &str,
    unit: &Unit,
) -> Result<Vec<f64>, ReadError> {
    let sheet = &sheet;
    let column = sheet.column(axis)?;
    let conversion = sheet.conversion(column, unit)?;
    let mut numbers = Vec::with_capacity(sheet.records.len());
    for record in &sheet.records {
        let x = sheet.number(record, column).and_then(|x| {
            let x = x.and_then(|x| conversion.apply(x)).filter(|x| x.is_finite());
            x.ok_or_else(|| {
                let cell = &record.cells[column];
                let text = format!("expected a finite number, found `{cell}`");
                sheet.complain(record, column, text)
            })
        });
        numbers.extend(faults.take(record.line, x));
    }
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    faults.or(numbers)
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

/// Returns the standard deviation of a value; fails if it is not above zero.
fn stated(
    sheet: &Sheet,
    record: &Record,
    (column, conversion): &(usize, Conversion),
) -> Result<f64, ReadError> {
    let sd = sheet.number(record, *column)?.and_then(|x| conversion.width(x));
    sd.filter(|sd| sd.is_finite() && *sd > 0.0).ok_or_else(|| {
        let cell = &record.cells[*column];
        let text = format!("expected a standard deviation above zero, found `{cell}`");
        sheet
            .complain(record, *column, text)
            .help("a value that is not to be used has a blank cell, or 1 in a column `mask`")
    })
}

/// Rejects columns that nothing reads. Such a column may hold a condition, and replicates of different conditions
/// must not be merged silently.
fn reject_unknown(
    sheet: &Sheet,
    ignore: &[String],
    known: impl Fn(usize) -> bool,
) -> Result<(), ReadError> {
    let unknown = (0..sheet.headings.len()).filter(|&c| {
        !known(c) && sheet.headings[c].name != SCENARIO && !ignore.contains(&sheet.headings[c].name)
    });
    let error = |column: usize| {
        let text = format!("column `{}` has no meaning here", sheet.headings[column].name);
        ReadError::new(&sheet.path, text)
            .at(format!("line {}, column {}", sheet.heading_line, column + 1))
            .help("list it under `ignore` if it means nothing, or make it a scenario if it is a condition")
    };
    ReadError::of_all(unknown.map(error)).map_or(Ok(()), Err)
}

/// Rejects tables in which a sensor or a time of the response has no row at all, not even one without a value.
fn reject_absent(sheet: &Sheet, layout: &Layout, found: &[Rows], faults: &mut Faults) {
    let mut seen: Vec<Vec<bool>> = layout.axes.iter().map(|a| vec![false; a.len()]).collect();
    for flat in 0..layout.len() {
        if found.iter().any(|rows| rows.lines[flat] > 0) {
            for (axis, i) in layout.place(flat).into_iter().enumerate() {
                seen[axis][i] = true;
            }
        }
    }
    for (axis, seen) in layout.axes.iter().zip(seen) {
        let absent: Vec<usize> = (0..seen.len()).filter(|&i| !seen[i]).collect();
        let Some(first) = absent.first() else { continue };
        let more = match absent.len() - 1 {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let text = format!("has no row for {} `{}`{more}", axis.name, axis.text(*first));
        let help = "a value that was not measured is a row with a blank cell, or a shorter axis";
        faults.note(0, ReadError::new(&sheet.path, text).help(help));
    }
}

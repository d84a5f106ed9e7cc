//! Replicated measurements in a long table.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Layout, Measurements, Unit};
use lacuna::plugin::reader::ReadError;

use super::gathered::Gathered;
use crate::readers::cells::LongColumns;
use crate::readers::faults::Faults;
use crate::readers::noise::{MASK, REPLICATE, SIGMA, left_out};
use crate::readers::scenario::Part;
use crate::readers::sheet::{Conversion, Record, Sheet};

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

/// Reads the table row by row: one replicate for each name in the column `replicate`, or a single one without that column.
pub(super) fn measurements(
    part: Part,
    layout: &Layout,
    ignore: &[String],
) -> Result<Measurements, ReadError> {
    let sheet = &part.sheet.clone();
    let columns = match Columns::find(sheet, layout, ignore) {
        Ok(columns) => columns,
        Err(error) => {
            let mut faults = part.each(|_, _| {})?;
            faults.note(sheet.heading_line, error);
            return faults.or(Measurements::new(layout.clone(), Vec::new()));
        }
    };
    let mut gathered = Gathered::new(layout, columns.sigma.is_some());
    let mut faults = part.each(|record, faults| {
        let Some(row) = faults.take(record.line, columns.row(sheet, record)) else { return };
        let sd = row.value.map(|_| row.sd);
        if let Err(first) = gathered.add(row.replicate, row.place, record.line, (row.value, sd)) {
            faults.note(record.line, columns.twice(sheet, record, layout, &row, first));
        }
    })?;
    if faults.is_empty() {
        reject_absent(sheet, layout, gathered.seen(), &mut faults);
    }
    faults.or(Measurements::new(layout.clone(), gathered.replicates()))
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

/// Number of coordinates from which on repeated ones are removed while a table is read.
const REPEATED: usize = 1 << 20;

/// Returns the numbers of an axis that appear in the table, in increasing order and in `unit`.
pub(super) fn grid(part: Part, axis: &str, unit: &Unit) -> Result<Vec<f64>, ReadError> {
    let sheet = &part.sheet.clone();
    let column = sheet.column(axis)?;
    let conversion = sheet.conversion(column, unit)?;
    let mut numbers = Vec::new();
    let different = |numbers: &mut Vec<f64>| {
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
    };
    let mut most = REPEATED;
    let faults = part.each(|record, faults| {
        let x = sheet.number(record, column).and_then(|x| {
            let x = x.and_then(|x| conversion.apply(x)).filter(|x| x.is_finite());
            x.ok_or_else(|| {
                let cell = &record.cells[column];
                let text = format!("expected a finite number, found `{cell}`");
                sheet.complain(record, column, text)
            })
        });
        numbers.extend(faults.take(record.line, x));
        if numbers.len() >= most {
            different(&mut numbers);
            most = REPEATED.max(2 * numbers.len());
        }
    })?;
    different(&mut numbers);
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
fn reject_absent(sheet: &Sheet, layout: &Layout, rows: &[bool], faults: &mut Faults) {
    let mut seen: Vec<Vec<bool>> = layout.axes.iter().map(|a| vec![false; a.len()]).collect();
    for flat in (0..layout.len()).filter(|&flat| rows[flat]) {
        for (axis, i) in layout.place(flat).into_iter().enumerate() {
            seen[axis][i] = true;
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

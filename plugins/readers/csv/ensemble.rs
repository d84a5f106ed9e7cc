//! The responses of all runs in one table, long or wide.

use std::collections::BTreeMap;

use lacuna::data::Layout;
use lacuna::plugin::reader::ReadError;

use crate::readers::cells::{Headings, LongColumns};
use crate::readers::faults::Faults;
use crate::readers::runs::Run;
use crate::readers::sheet::{Record, Sheet};

type Values = Vec<Option<f64>>;

/// Returns the values of each run, in the order of the runs. A value is `None` if the table has none; a run is `None`
/// if it has no row.
pub(super) fn responses(
    (sheet, mut faults): (Sheet, Faults),
    runs: &[Run],
    layout: &Layout,
) -> Result<Vec<Option<Values>>, ReadError> {
    let long = !layout.axes.is_empty() && layout.axes.iter().any(|a| sheet.find(&a.name).is_some());
    let read = Names::new(&sheet, runs).and_then(|names| {
        if long {
            long_table(&sheet, &names, layout, &mut faults)
        } else {
            Ok(wide_table(&sheet, &names, layout, &mut faults))
        }
    });
    let values = faults.take(sheet.heading_line, read);
    faults.or(values.unwrap_or_default())
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
        let name = &record.cells[self.column];
        self.positions.get(name).copied().ok_or_else(|| {
            let text = format!("run `{name}` is not in the table of parameters");
            sheet.complain(record, self.column, text)
        })
    }
}

fn long_table(
    sheet: &Sheet,
    names: &Names<'_>,
    layout: &Layout,
    faults: &mut Faults,
) -> Result<Vec<Option<Values>>, ReadError> {
    let columns = LongColumns::find(sheet, layout)?;
    let mut values = vec![None; names.positions.len()];
    let mut lines = vec![vec![0; layout.len()]; names.positions.len()];
    for record in &sheet.records {
        let run = faults.take(record.line, names.position(sheet, record));
        let place = faults.take(record.line, columns.place(sheet, record));
        let number = faults.take(record.line, columns.number(sheet, record));
        let (Some(run), Some(place), Some(number)) = (run, place, number) else { continue };
        let first = lines[run][place];
        if first > 0 {
            let text = format!(
                "a second value of run `{}` for {}; the first is in line {first}",
                &record.cells[names.column],
                layout.describe(place)
            );
            faults.note(record.line, sheet.complain(record, columns.value, text));
            continue;
        }
        lines[run][place] = record.line;
        values[run].get_or_insert_with(|| vec![None; layout.len()])[place] = number;
    }
    Ok(values)
}

fn wide_table(
    sheet: &Sheet,
    names: &Names<'_>,
    layout: &Layout,
    faults: &mut Faults,
) -> Vec<Option<Values>> {
    let mut columns = Vec::with_capacity(layout.len());
    let mut headed: Vec<Option<usize>> = vec![None; layout.len()];
    let places = Headings::of(layout);
    for column in (0..sheet.headings.len()).filter(|&c| c != names.column) {
        let at = |text: String| {
            ReadError::new(&sheet.path, text).at(format!(
                "line {}, column {}",
                sheet.heading_line,
                column + 1
            ))
        };
        let heading = &sheet.headings[column].name;
        let place = places.place(heading).map_err(|text| {
            at(text).help("a wide table has the column `run` and one for each value of the response, headed by its place")
        });
        let conversion = sheet.conversion(column, &layout.unit);
        let conversion = faults.take(sheet.heading_line, conversion);
        let place = faults.take(sheet.heading_line, place);
        let (Some(place), Some(conversion)) = (place, conversion) else { continue };
        if let Some(other) = headed[place].replace(column) {
            let text = format!("`{heading}` means the same value as column {}", other + 1);
            faults.note(sheet.heading_line, at(text));
        }
        columns.push((column, place, conversion));
    }
    let mut values = vec![None; names.positions.len()];
    let mut lines = vec![0; names.positions.len()];
    for record in &sheet.records {
        let Some(run) = faults.take(record.line, names.position(sheet, record)) else { continue };
        if lines[run] > 0 {
            let name = &record.cells[names.column];
            let text = format!("a second row of run `{name}`; the first is line {}", lines[run]);
            faults.note(record.line, sheet.complain(record, names.column, text));
            continue;
        }
        lines[run] = record.line;
        let mut own = vec![None; layout.len()];
        for (column, place, conversion) in &columns {
            let number = faults.take(record.line, sheet.number(record, *column)).flatten();
            own[*place] = number.and_then(|x| conversion.apply(x));
        }
        values[run] = Some(own);
    }
    values
}

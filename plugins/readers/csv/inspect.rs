//! Contents of a table.

use std::collections::BTreeSet;

use lacuna::data::Table;
use lacuna::data::table::Column;
use lacuna::plugin::reader::{Contents, Variable};

use crate::readers::contents::{fact, limits};
use crate::readers::listed;
use crate::readers::sheet::Sheet;

pub(super) fn contents(sheet: &Sheet) -> Contents {
    let mut facts = vec![fact("rows", sheet.records.len()), fact("columns", sheet.headings.len())];
    let mut variables = Vec::new();
    let time = (0..sheet.headings.len())
        .find(|&c| sheet.headings[c].name.eq_ignore_ascii_case("time"))
        .and_then(|c| numbers(sheet, c));
    for (column, heading) in sheet.headings.iter().enumerate() {
        let Some(numbers) = numbers(sheet, column) else {
            let texts: BTreeSet<&str> =
                sheet.records.iter().map(|record| &record.cells[column]).collect();
            let texts: Vec<&str> = texts.into_iter().collect();
            facts.push(fact(&heading.name, format!("{} texts: {}", texts.len(), listed(&texts))));
            continue;
        };
        let (range, not_finite) = limits(&numbers.values);
        let mut columns: Vec<Column> =
            time.iter().filter(|t| t.name != heading.name).cloned().collect();
        columns.push(numbers);
        variables.push(Variable {
            name: heading.name.clone(),
            on: "column".to_owned(),
            axes: vec![("row".to_owned(), sheet.records.len())],
            unit: heading.unit.clone(),
            range,
            not_finite,
            signals: Table { columns },
        });
    }
    Contents { format: "comma-separated table".to_owned(), facts, variables }
}

/// Returns a column as numbers, missing ones as NaN; `None` if it holds anything else.
fn numbers(sheet: &Sheet, column: usize) -> Option<Column> {
    let heading = &sheet.headings[column];
    let values: Option<Vec<f64>> = sheet
        .records
        .iter()
        .map(|record| sheet.number(record, column).ok().map(|x| x.unwrap_or(f64::NAN)))
        .collect();
    Some(Column { name: heading.name.clone(), unit: heading.unit.clone(), values: values? })
}

//! The part of a file that belongs to one scenario of a study.

use std::path::Path;

use lacuna::plugin::Context;
use lacuna::plugin::reader::{ReadError, scenario_path};
use lacuna::text::problem::Complaints;

use super::faults::Faults;
use super::listed;
use super::sheet::Sheet;

/// Placeholder for the name of a scenario in a path.
pub const PLACE: &str = "{scenario}";

/// Returns true if each scenario has its own file.
pub fn each_has_its_file(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.contains(PLACE))
}

/// Reports files named in the options that do not exist, for each scenario.
pub fn check_files<'p>(
    paths: impl IntoIterator<Item = (&'p str, Option<&'p Path>)>,
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    for (key, path) in paths {
        let Some(path) = path else { continue };
        for scenario in context.scenarios {
            let file = scenario_path(context.directory, path, scenario.label());
            if !file.is_file() {
                complaints.at(key).say(format!("there is no file `{}`", file.display()));
            }
            if !each_has_its_file(path) {
                break;
            }
        }
    }
}

/// Reads the rows of a table that belong to a scenario: all rows of a file of its own, otherwise those with its name
/// in the column `named`, which is `scenario` unless the options name another. In a study without scenarios all rows are read, and such a column is an error unless it
/// is ignored.
pub fn sheet(
    directory: &Path,
    path: &Path,
    scenario: Option<&str>,
    ignore: &[String],
    named: &str,
) -> Result<(Sheet, Faults), ReadError> {
    let (sheet, faults) = Sheet::open(&scenario_path(directory, path, scenario))?;
    let column = sheet.find(named).filter(|_| !ignore.iter().any(|name| name == named));
    match (column, scenario) {
        (None, Some(_)) if !each_has_its_file(path) => Err(ReadError::new(
            &sheet.path,
            format!("has no column `{named}`, and the study has scenarios"),
        )
        .help(format!("add the column, or name a file for each scenario: a path with `{PLACE}`"))),
        (None, _) => Ok((sheet, faults)),
        (Some(column), None) => {
            let text = format!("has a column `{named}`, and the study has no scenarios");
            Err(ReadError::new(&sheet.path, text)
                .at(format!("line {}, column {}", sheet.heading_line, column + 1))
                .help("add `[[scenario]]` sections, or list the column under `ignore`"))
        }
        (Some(column), Some(name)) => Ok((some(sheet, column, name, named)?, faults)),
    }
}

/// The different names in a column of a table, in the order of its rows.
pub fn names(path: &Path, column: &str) -> Result<Vec<String>, ReadError> {
    let (sheet, _) = Sheet::open(path)?;
    let Some(place) = sheet.find(column) else {
        let headings: Vec<String> = sheet.headings.iter().map(|h| h.name.clone()).collect();
        let text = format!("has no column `{column}`; it has {}", listed(&headings));
        return Err(ReadError::new(&sheet.path, text).help("name the column of the groups"));
    };
    let mut names: Vec<String> = Vec::new();
    for record in &sheet.records {
        let name = record.cells[place].trim();
        if name.is_empty() {
            return Err(sheet.complain(record, place, "the group has no name".to_owned()));
        }
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    Ok(names)
}

fn some(mut sheet: Sheet, column: usize, name: &str, named: &str) -> Result<Sheet, ReadError> {
    let mut known: Vec<String> = sheet.records.iter().map(|r| r.cells[column].to_owned()).collect();
    sheet.records.retain(|record| &record.cells[column] == name);
    if sheet.records.is_empty() {
        known.sort();
        known.dedup();
        let text = format!("has no row of {named} `{name}`; it has {}", listed(&known));
        return Err(ReadError::new(&sheet.path, text));
    }
    Ok(sheet)
}

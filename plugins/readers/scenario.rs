//! The part of a file that belongs to one scenario of a study.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use lacuna::plugin::Context;
use lacuna::plugin::reader::{ReadError, scenario_path};
use lacuna::text::problem::Complaints;

use super::faults::Faults;
use super::listed;
use super::rows::Rows;
use super::sheet::{Record, Sheet};

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
    let part = Part::open(directory, path, scenario, ignore, named)?;
    let mut sheet = part.sheet.clone();
    let faults = part.each(|record, _| sheet.records.push(record.clone()))?;
    Ok((sheet, faults))
}

/// The part of a table that belongs to a scenario, row by row; see [`sheet`].
pub struct Part {
    /// Columns of the table, without records.
    pub sheet: Sheet,
    rows: Rows<BufReader<File>>,
    faults: Faults,
    only: Option<Only>,
}

/// The scenario whose rows are read.
struct Only {
    column: usize,
    /// Name of the column.
    named: String,
    name: String,
}

impl Part {
    /// Opens a table and finds the column of the scenarios.
    pub fn open(
        directory: &Path,
        path: &Path,
        scenario: Option<&str>,
        ignore: &[String],
        named: &str,
    ) -> Result<Self, ReadError> {
        let (sheet, rows, faults) = Rows::open(&scenario_path(directory, path, scenario))?;
        let column = sheet.find(named).filter(|_| !ignore.iter().any(|name| name == named));
        let only = match (column, scenario) {
            (None, Some(_)) if !each_has_its_file(path) => {
                let text = format!("has no column `{named}`, and the study has scenarios");
                let help = format!(
                    "add the column, or name a file for each scenario: a path with `{PLACE}`"
                );
                return Err(ReadError::new(&sheet.path, text).help(help));
            }
            (None, _) => None,
            (Some(column), None) => {
                let text = format!("has a column `{named}`, and the study has no scenarios");
                return Err(ReadError::new(&sheet.path, text)
                    .at(format!("line {}, column {}", sheet.heading_line, column + 1))
                    .help("add `[[scenario]]` sections, or list the column under `ignore`"));
            }
            (Some(column), Some(name)) => {
                Some(Only { column, named: named.to_owned(), name: name.to_owned() })
            }
        };
        Ok(Self { sheet, rows, faults, only })
    }

    /// Gives each row of the scenario to `visit`, which may add errors, and returns all errors; fails if the scenario has
    /// no row.
    pub fn each(
        mut self,
        mut visit: impl FnMut(&Record, &mut Faults),
    ) -> Result<Faults, ReadError> {
        let mut record = Record::default();
        let mut others: BTreeSet<String> = BTreeSet::new();
        let mut found = false;
        while self.rows.next(&mut record, &mut self.faults) {
            if let Some(Only { column, name, .. }) = &self.only {
                let own = &record.cells[*column];
                if own != name {
                    if !found && !others.contains(own) {
                        others.insert(own.to_owned());
                    }
                    continue;
                }
            }
            found = true;
            visit(&record, &mut self.faults);
        }
        match &self.only {
            Some(Only { named, name, .. }) if !found => {
                let known: Vec<String> = others.into_iter().collect();
                let text = format!("has no row of {named} `{name}`; it has {}", listed(&known));
                Err(ReadError::new(&self.sheet.path, text))
            }
            _ => Ok(self.faults),
        }
    }
}

/// The different names in a column of a table, in the order of its rows.
pub fn names(path: &Path, column: &str) -> Result<Vec<String>, ReadError> {
    let (sheet, mut rows, mut faults) = Rows::open(path)?;
    let Some(place) = sheet.find(column) else {
        let headings: Vec<String> = sheet.headings.iter().map(|h| h.name.clone()).collect();
        let text = format!("has no column `{column}`; it has {}", listed(&headings));
        return Err(ReadError::new(&sheet.path, text).help("name the column of the groups"));
    };
    let mut names: Vec<String> = Vec::new();
    let mut record = Record::default();
    while rows.next(&mut record, &mut faults) {
        let name = record.cells[place].trim();
        if name.is_empty() {
            return Err(sheet.complain(&record, place, "the group has no name".to_owned()));
        }
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    Ok(names)
}

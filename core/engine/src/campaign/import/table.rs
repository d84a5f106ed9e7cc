//! Table that describes finished runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use csv::StringRecord;
use lacuna::data::Unit;
use lacuna::run::{Stop, files};

use crate::study::Study;

/// One run of the table.
pub(super) struct Row {
    pub run: String,
    /// Parameters, in the study's order and units.
    pub point: Vec<f64>,
    /// File of each scenario.
    pub files: Vec<Option<PathBuf>>,
}

/// Meaning of the columns.
struct Columns<'a> {
    run: Option<usize>,
    file: usize,
    scenario: Option<usize>,
    /// For each parameter its column, the factor to the study's unit, and its name.
    parameters: Vec<(usize, f64, &'a str)>,
}

/// One line of the table.
struct Line {
    run: String,
    point: Vec<f64>,
    scenario: usize,
    file: String,
}

/// Runs of the table, each with all its scenarios.
pub(super) fn rows(study: &Study, table: &Path) -> Result<Vec<Row>, Stop> {
    let bytes = files::read(table)?;
    let wrong = |place: &str, what: String| {
        Stop::new(format!("{}{place}: {what}", table.display()))
            .help("the columns are `run`, `file`, `scenario` in a study with scenarios, and one for each parameter, such as `density [kg/m3]`")
    };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
    let header = reader.headers().map_err(|error| wrong("", error.to_string()))?.clone();
    let columns = columns(study, &header).map_err(|what| wrong(", line 1", what))?;
    let folder = table.parent().unwrap_or(Path::new(""));
    let mut found: Vec<Row> = Vec::new();
    let mut order: BTreeMap<String, usize> = BTreeMap::new();
    for (number, record) in reader.records().enumerate() {
        let place = format!(", line {}", number + 2);
        let record = record.map_err(|error| wrong(&place, error.to_string()))?;
        let line = line(study, &columns, &record, number).map_err(|what| wrong(&place, what))?;
        let next = found.len();
        let index = *order.entry(line.run.clone()).or_insert(next);
        if index == next {
            let files = vec![None; study.scenarios.len()];
            found.push(Row { run: line.run.clone(), point: line.point.clone(), files });
        }
        let file = folder.join(&line.file);
        add(study, &mut found[index], line, file).map_err(|what| wrong(&place, what))?;
    }
    if found.is_empty() {
        return Err(wrong("", "there is no run in it".to_owned()));
    }
    Ok(found)
}

/// Adds a line to its run.
fn add(study: &Study, row: &mut Row, line: Line, file: PathBuf) -> Result<(), String> {
    let run = &row.run;
    if row.point != line.point {
        return Err(format!("run `{run}` has other parameters in another line"));
    }
    if row.files[line.scenario].is_some() {
        let scenario = &study.scenarios[line.scenario];
        let of =
            scenario.label().map_or(String::new(), |name| format!(" of the scenario `{name}`"));
        return Err(format!("there are two files for run `{run}`{of}"));
    }
    row.files[line.scenario] = Some(file);
    Ok(())
}

fn columns<'a>(study: &'a Study, header: &StringRecord) -> Result<Columns<'a>, String> {
    let column = |name: &str| header.iter().position(|heading| heading == name);
    let file = column("file").ok_or("there is no column `file`")?;
    let (run, scenario) = (column("run"), column("scenario"));
    if study.scenarios.len() > 1 {
        let known = scenarios(study);
        scenario.ok_or_else(|| format!("there is no column `scenario`, which says {known}"))?;
        run.ok_or(
            "there is no column `run`, which says what lines of several scenarios are one run",
        )?;
    }
    let parameters = study.parameters.iter().map(|parameter| {
        let found = header
            .iter()
            .enumerate()
            .find_map(|(i, heading)| Some((i, unit_behind(heading, &parameter.name)?)));
        let (name, own) = (parameter.name.as_str(), &parameter.unit);
        let (i, unit) =
            found.ok_or_else(|| format!("there is no column for the parameter `{name}`"))?;
        let given = if unit.is_empty() { Ok(own.clone()) } else { Unit::parse(unit) };
        let unit = given.map_err(|error| error.to_string())?;
        let factor = unit
            .factor_to(own)
            .ok_or_else(|| format!("`{unit}` does not convert to `{own}`, the unit of `{name}`"))?;
        Ok((i, factor, name))
    });
    let parameters = parameters.collect::<Result<_, String>>()?;
    Ok(Columns { run, file, scenario, parameters })
}

/// Unit in the heading of a parameter, empty if there is none: `height[low] [m]` is `height[low]` in metres.
fn unit_behind<'a>(heading: &'a str, name: &str) -> Option<&'a str> {
    let rest = heading.strip_prefix(name)?.trim();
    let unit = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).map(str::trim);
    if rest.is_empty() { Some("") } else { unit.filter(|unit| !unit.contains('[')) }
}

/// Names of the scenarios.
fn scenarios(study: &Study) -> String {
    let names: Vec<String> = study.scenarios.iter().map(|s| format!("`{}`", s.name)).collect();
    names.join(" or ")
}

fn line(
    study: &Study,
    columns: &Columns<'_>,
    record: &StringRecord,
    number: usize,
) -> Result<Line, String> {
    let run =
        columns.run.map_or_else(|| format!("hand{:03}", number + 1), |i| record[i].to_owned());
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if run.is_empty() || !run.chars().all(is_plain) {
        return Err(format!("`{run}` is no name of a run: expected letters, digits, `-` and `_`"));
    }
    let number_in = |&(i, factor, name): &(usize, f64, &str)| {
        let value = record[i].parse::<f64>().ok().filter(|x| x.is_finite());
        let value = value.map(|x| x * factor);
        value.ok_or_else(|| format!("expected a number for `{name}`, found `{}`", &record[i]))
    };
    let point = columns.parameters.iter().map(number_in).collect::<Result<_, _>>()?;
    let scenario = match columns.scenario.map(|i| &record[i]) {
        Some(name) => study.scenarios.iter().position(|s| s.name == name).ok_or_else(|| {
            match scenarios(study).as_str() {
                "``" => format!("the study has no scenarios, found `{name}`"),
                known => format!("expected the scenario {known}, found `{name}`"),
            }
        })?,
        None => 0,
    };
    Ok(Line { run, point, scenario, file: record[columns.file].to_owned() })
}

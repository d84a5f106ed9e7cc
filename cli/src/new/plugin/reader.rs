//! `skeleton`: columns of text.

use std::path::{Path, PathBuf};

use lacuna::data::table::Column;
use lacuna::data::{Coordinates, Layout, Measurements, Replicate, Table};
use lacuna::plugin::reader::{Contents, MeasurementSource, ReadError, Variable, scenario_path};
use lacuna::plugin::{Component, Context, Reader};
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Columns of text separated by blanks or commas, as instruments write them: one value per line.
///
/// The first line that is not a comment holds the names of the columns: one for each axis of the response, one with the
/// name of the response, and for measurements one called `replicate`. Numbers are in the units of the study; `nan`
/// marks a missing value. Other columns and other positions are ignored. For names with blanks, units in headings and
/// simulation runs use `csv`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// File with the measurements, relative to the study; `{scenario}` is replaced by a scenario's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Prefix of comment lines.
    pub comment: String,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { path: None, comment: "#".into() }
    }
}

impl Component for Skeleton {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.comment.trim().is_empty() {
            complaints
                .at("comment")
                .say("every line would be a comment")
                .expected("the beginning of a comment, such as `#`");
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let names = context.scenarios.iter().map(|scenario| Some(scenario.name.as_str()));
        for name in names.chain(context.scenarios.is_empty().then_some(None)) {
            for file in self.files(context.directory, name).iter().filter(|file| !file.is_file()) {
                let text = format!("there is no file {}", file.display());
                complaints.at("path").say(text);
            }
        }
    }
}

/// A file as names and lines of cells.
struct Sheet {
    path: PathBuf,
    names: Vec<String>,
    /// Number of each line, and its cells.
    lines: Vec<(usize, Vec<String>)>,
}

fn cells(line: &str) -> Vec<String> {
    let parts = line.split(|c: char| c == ',' || c.is_whitespace());
    parts.filter(|cell| !cell.is_empty()).map(str::to_owned).collect()
}

impl Sheet {
    fn read(path: &Path, comment: &str) -> Result<Self, ReadError> {
        let bytes = std::fs::read(path)
            .map_err(|error| ReadError::new(path, format!("cannot be read: {error}")))?;
        let text = String::from_utf8(bytes)
            .map_err(|_| ReadError::new(path, "expected text in UTF-8, found other bytes"))?;
        let mut lines = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with(comment))
            .map(|(number, line)| (number, cells(line)));
        let (_, names) = lines.next().ok_or_else(|| ReadError::new(path, "there is no line"))?;
        let lines: Vec<_> = lines.collect();
        if let Some((number, cells)) = lines.iter().find(|(_, cells)| cells.len() != names.len()) {
            let text = format!("expected {} columns, found {}", names.len(), cells.len());
            return Err(ReadError::new(path, text).at(format!("line {number}")));
        }
        Ok(Self { path: path.to_owned(), names, lines })
    }

    fn column(&self, name: &str) -> Result<usize, ReadError> {
        self.names.iter().position(|other| other == name).ok_or_else(|| {
            let found = self.names.join("`, `");
            ReadError::new(&self.path, format!("there is no column `{name}`"))
                .help(format!("the columns are `{found}`"))
        })
    }

    fn number(
        &self,
        (line, cells): &(usize, Vec<String>),
        column: usize,
    ) -> Result<f64, ReadError> {
        let cell = &cells[column];
        cell.parse().map_err(|_| {
            let place = format!("line {line}, column {}", column + 1);
            ReadError::new(&self.path, format!("expected a number, found `{cell}`")).at(place)
        })
    }

    /// Line number, index in the response and value of each line that belongs to the response; `nan` gives no value.
    fn values(&self, layout: &Layout) -> Result<Vec<(usize, usize, Option<f64>)>, ReadError> {
        let axes = layout.axes.iter().map(|axis| self.column(&axis.name));
        let axes: Vec<usize> = axes.collect::<Result<_, _>>()?;
        let value = self.column(&layout.name)?;
        let mut found = Vec::new();
        for (i, line) in self.lines.iter().enumerate() {
            let mut place = Vec::new();
            for (axis, &column) in layout.axes.iter().zip(&axes) {
                place.push(match &axis.coordinates {
                    Coordinates::Labels(_) => axis.position(&line.1[column]),
                    Coordinates::Grid { values, .. } => nearest(values, self.number(line, column)?),
                });
            }
            let y = self.number(line, value)?;
            if y.is_infinite() {
                let text = format!("expected a finite number, found {y}");
                return Err(ReadError::new(&self.path, text).at(format!("line {}", line.0)));
            }
            if let Some(place) = place.into_iter().collect::<Option<Vec<usize>>>() {
                found.push((i, layout.index(&place), (!y.is_nan()).then_some(y)));
            }
        }
        Ok(found)
    }

    fn repeated(&self, layout: &Layout, line: usize, place: usize) -> ReadError {
        let text = format!("a second value for {}", layout.describe(place));
        ReadError::new(&self.path, text).at(format!("line {}", self.lines[line].0))
    }
}

/// Index of a number on a grid, to nine digits.
fn nearest(grid: &[f64], x: f64) -> Option<usize> {
    let span = grid.last()? - grid.first()?;
    grid.iter().position(|g| (g - x).abs() <= 1e-9 * span.max(g.abs()))
}

impl Reader for Skeleton {
    fn recognises(&self, path: &Path, head: &[u8]) -> bool {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let text = std::str::from_utf8(head).unwrap_or_default();
        let mut lines = text.lines().filter(|line| !line.trim_start().starts_with(&self.comment));
        extension.eq_ignore_ascii_case("columns")
            && lines.next().is_some_and(|line| cells(line).len() > 1)
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        let sheet = Sheet::read(path, &self.comment)?;
        let variable = |(j, name): (usize, &String)| {
            let parsed = |(_, cells): &(usize, Vec<String>)| cells[j].parse().unwrap_or(f64::NAN);
            let values: Vec<f64> = sheet.lines.iter().map(parsed).collect();
            let finite = || values.iter().copied().filter(|x| x.is_finite());
            let range = finite().next().map(|first| {
                finite().fold((first, first), |(low, high), x| (low.min(x), high.max(x)))
            });
            Variable {
                name: name.clone(),
                on: "column".into(),
                axes: vec![("line".into(), values.len())],
                unit: None,
                range,
                not_finite: values.len() - finite().count(),
                signals: Table { columns: vec![Column { name: name.clone(), unit: None, values }] },
            }
        };
        let variables = sheet.names.iter().enumerate().map(variable).collect();
        Ok(Contents { format: "columns of text".into(), facts: Vec::new(), variables })
    }

    fn names_files(&self) -> bool {
        self.path.is_some()
    }

    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        let [path] = &self.files(source.directory, source.scenario)[..] else {
            let text = "missing key `path`: the file with the measurements";
            return Err(ReadError::new(source.directory, text));
        };
        let sheet = Sheet::read(path, &self.comment)?;
        let name = sheet.column("replicate")?;
        let mut replicates: Vec<Replicate> = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        for (line, place, y) in sheet.values(source.layout)? {
            let name = &sheet.lines[line].1[name];
            if !seen.insert((name, place)) {
                return Err(sheet.repeated(source.layout, line, place));
            }
            let known = replicates.iter().position(|replicate| replicate.name == *name);
            let r = known.unwrap_or_else(|| {
                let values = vec![None; source.layout.len()];
                replicates.push(Replicate::new(name.clone(), values));
                replicates.len() - 1
            });
            replicates[r].values[place] = y;
        }
        Ok(Measurements::new(source.layout.clone(), replicates))
    }

    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let sheet = Sheet::read(path, &self.comment)?;
        let mut response = vec![None; layout.len()];
        for (line, place, y) in sheet.values(layout)? {
            if response[place].is_some() {
                return Err(sheet.repeated(layout, line, place));
            }
            response[place] = y;
        }
        let missing = |i: usize| {
            ReadError::new(path, format!("there is no value for {}", layout.describe(i)))
        };
        response.into_iter().enumerate().map(|(i, y)| y.ok_or_else(|| missing(i))).collect()
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        self.path.iter().map(|path| scenario_path(directory, path, scenario)).collect()
    }
}

lacuna::register!(Reader, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Unit};
    use lacuna_contract::Sample;

    /// A folder for one test, with one file.
    fn folder(name: &str, file: &str, text: &str) -> PathBuf {
        let folder =
            std::env::temp_dir().join(format!("skeleton-reader-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(file), text).unwrap();
        folder
    }

    fn layout() -> Layout {
        let axes = vec![
            Axis::labels("sensor", ["A", "B"]),
            Axis::grid("time", vec![0.5, 1.0], Unit::dimensionless()),
        ];
        Layout { axes, ..Layout::number("y") }
    }

    #[test]
    fn it_keeps_the_contract() {
        let text = "# made by hand\nsensor time y\nA 0.5 1.25\nA 1 2.5\nB 0.5 -3e-4\nB 1 1234.5\n";
        let folder = folder("contract", "sound.columns", text);
        let values = vec![1.25, 2.5, -3e-4, 1234.5];
        let file = folder.join("sound.columns");
        let sample = Sample { file, layout: layout(), values, tolerance: 0.0 };
        let judged = lacuna_contract::reader("skeleton", &Skeleton::default(), &sample, &folder);
        assert_eq!(judged, Ok(()));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn replicates_may_lack_values() {
        let text = "replicate,sensor,time,y\np1,A,0.5,1\np1,B,1,nan\np2,B,1,4\np2,C,1,9\n";
        let folder = folder("replicates", "y.columns", text);
        let reader = Skeleton { path: Some("y.columns".into()), ..Skeleton::default() };
        let source = MeasurementSource { directory: &folder, scenario: None, layout: &layout() };
        let found = reader.measurements(&source).unwrap();
        let values: Vec<_> = found.replicates.iter().map(|r| (&*r.name, &r.values[..])).collect();
        let [first, second] = [[Some(1.0), None, None, None], [None, None, None, Some(4.0)]];
        assert_eq!(values, [("p1", &first[..]), ("p2", &second[..])]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}

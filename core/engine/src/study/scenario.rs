//! `[[scenario]]`: the known conditions of a study, as written.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::data::{Condition, Function, Interpolation, Scenario, Unit};
use lacuna::text::labels;
use lacuna::text::response::Axes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::Quantity;

/// Known conditions under which the response was simulated and measured, such as a beam power, a test specimen, or an
/// applied force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScenarioSection {
    /// Name of the scenario, as in the column `scenario` of measurements and runs.
    pub name: String,
    /// Groups to which the scenario belongs, such as `{ target = "T24", batch = "A" }`. A parameter with `by = "target"` has a
    /// value for each.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<String, String>,
    /// Known values. A value with the name of an input of the model sets this input; expressions may use all of them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, Quantity>,
    /// Known functions of one variable, tabulated in CSV files:
    /// `{ force = { path = "force.csv", at = "time", value = "force" } }`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub functions: BTreeMap<String, FunctionSection>,
    /// `false` for conditions under which nothing was measured so far: the response there is only predicted, and
    /// `lacuna next STUDY` weighs measurements there against others.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub measured: bool,
    /// Axes of the response in this scenario, in place of those of the same name in `[response]`: another time grid, or
    /// some of the sensors.
    #[serde(default, skip_serializing_if = "is_empty")]
    pub axes: Axes,
}

fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref)] // Serde passes a reference.
fn is_yes(measured: &bool) -> bool {
    *measured
}

fn is_empty(axes: &Axes) -> bool {
    axes.0.is_empty()
}

/// A function of one variable from two columns of a table, interpolated linearly between the rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FunctionSection {
    /// CSV file with headings such as `time [s]`, relative to the study file.
    pub path: PathBuf,
    /// Name of the column of the variable; its values must increase strictly.
    pub at: String,
    /// Name of the column of the function's values.
    pub value: String,
    /// The function between two rows: `"linear"`, `"hold"` (the value of the row before, as of a digital output) or
    /// `"spline"` (smooth, for samples of a continuous signal).
    #[serde(default, skip_serializing_if = "Interpolation::is_linear")]
    pub interpolation: Interpolation,
}

impl ScenarioSection {
    /// Reads the conditions and their tables; problems are passed to `complain` with their key.
    pub fn read(
        &self,
        directory: &Path,
        complain: &mut impl FnMut(&str, String),
    ) -> Option<Scenario> {
        let condition = |(name, quantity): (&String, &Quantity)| Condition {
            name: name.clone(),
            value: quantity.value,
            unit: quantity.unit.clone(),
        };
        let mut functions = Vec::new();
        for (name, section) in &self.functions {
            match section.read(name, directory) {
                Ok(function) => functions.push(function.into()),
                Err(reason) => complain(&format!("functions.{name}"), reason),
            }
        }
        let mut whole = functions.len() == self.functions.len();
        for (kind, label) in &self.labels {
            if let Err(reason) = labels::check(label) {
                complain(&format!("labels.{kind}"), format!("the label `{kind}`: {reason}"));
                whole = false;
            }
        }
        let values = self.values.iter().map(condition).collect();
        whole.then(|| Scenario {
            name: self.name.clone(),
            labels: self.labels.clone(),
            values,
            functions,
            fields: Vec::new(),
            unmeasured: !self.measured,
        })
    }
}

/// The name and the unit in a heading such as `time [s]`.
fn heading(text: &str) -> Result<(&str, Unit), String> {
    match text.trim().strip_suffix(']').and_then(|text| text.rsplit_once('[')) {
        None => Ok((text.trim(), Unit::dimensionless())),
        Some((name, unit)) => {
            Ok((name.trim(), Unit::parse(unit).map_err(|error| error.to_string())?))
        }
    }
}

impl FunctionSection {
    /// Reads the table as a function of this name.
    pub(super) fn read(&self, name: &str, directory: &Path) -> Result<Function, String> {
        let path = directory.join(&self.path);
        let wrong = |what: String| format!("{}: {what}", path.display());
        let mut table = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_path(&path)
            .map_err(|error| wrong(format!("cannot be opened: {error}")))?;
        let headings = table.headers().map_err(|error| wrong(error.to_string()))?.clone();
        let column = |wanted: &str| {
            for (i, text) in headings.iter().enumerate() {
                let (name, unit) = heading(text).map_err(&wrong)?;
                if name == wanted {
                    return Ok((i, unit));
                }
            }
            let all: Vec<String> = headings.iter().map(|h| format!("`{h}`")).collect();
            Err(wrong(format!("has no column `{wanted}`; it has {}", all.join(", "))))
        };
        let (at, at_unit) = column(&self.at)?;
        let (value, unit) = column(&self.value)?;
        let mut function = Function {
            name: name.to_owned(),
            at: Vec::new(),
            at_unit,
            values: Vec::new(),
            unit,
            interpolation: self.interpolation,
        };
        for record in table.records() {
            let record = record.map_err(|error| wrong(error.to_string()))?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |column: usize| {
                let cell = record.get(column).unwrap_or_default();
                let number: Option<f64> = cell.parse().ok().filter(|x: &f64| x.is_finite());
                number.ok_or_else(|| {
                    wrong(format!("line {line}: expected a finite number, found `{cell}`"))
                })
            };
            let (x, y) = (number(at)?, number(value)?);
            if function.at.last().is_some_and(|&before| before >= x) {
                let before = function.at[function.at.len() - 1];
                let text = format!("line {line}: expected `{}` above {before}, found {x}", self.at);
                return Err(wrong(text));
            }
            function.at.push(x);
            function.values.push(y);
        }
        if function.at.len() < 2 {
            let count = function.at.len();
            return Err(wrong(format!("expected at least two rows, found {count}")));
        }
        Ok(function)
    }
}

//! `[[field]]`: random fields as inputs of the model, by their Karhunen-Loève expansions.
//!
//! ```text
//! keys       the keys as written
//! expansion  eigenvalues and eigenfunctions of the covariance on the grid of places
//! check      fields against the model
//! ```

mod check;
mod expansion;
mod keys;

use std::path::Path;
use std::sync::Arc;

use lacuna::data::{Axis, Coordinates, Field, Parameter, Scenario, Unit};
use lacuna::expression::{Fault, Scope};
use lacuna::math::distribution::Distribution;
use lacuna::text::values::OpenFraction;
use lacuna::text::{Complaints, Node, Problems};
use lacuna_linalg::Matrix;

use super::sections;
use super::unknowns::{Unknown, UnknownKind};
use expansion::{Expansion, Keep};

pub(super) use check::check;
pub use keys::{FieldDistribution, FieldKernel, FieldSection, Level};

/// Largest number of places: the covariance is a dense matrix, whose eigenvalues are computed whenever a study is read.
const MOST_PLACES: usize = 1000;

/// Name of the table of a mean or median while it is evaluated.
const TABLE: &str = "level";

/// Share of the variance that is kept if the study states none.
const VARIANCE: f64 = 0.95;

/// The fields of all sections, beside these; `None` after reporting an error.
pub(super) fn fields(
    root: &Node,
    directory: &Path,
    problems: &mut Problems,
) -> Option<(Vec<FieldSection>, Vec<Arc<Field>>)> {
    let before = problems.len();
    let sections = sections::fields(root, problems)?;
    let mut complaints = Complaints::new(root, problems);
    let mut fields = Vec::new();
    for (i, section) in sections.iter().enumerate() {
        if sections[..i].iter().any(|other| other.name == section.name) {
            complaints
                .at(&format!("field.{}.name", section.name))
                .say(format!("there are two fields `{}`", section.name))
                .help("give each `[[field]]` its own name");
            continue;
        }
        fields.extend(field(section, directory, &mut complaints).map(Arc::new));
    }
    (problems.len() == before).then_some((sections, fields))
}

/// The axis of the places; `None` after reporting an error.
fn axis(section: &FieldSection, complaints: &mut Complaints<'_>) -> Option<Axis> {
    let path = format!("field.{}.axes", section.name);
    let [(name, written)] = &section.axes.0[..] else {
        complaints
            .at(&path)
            .say("a field has one coordinate")
            .expected(
                "one axis, such as `{ x = { first = 0, last = 1, count = 51, unit = \"m\" } }`",
            )
            .found(section.axes.0.len());
        return None;
    };
    let path = format!("{path}.{name}");
    let measured = |_: &Unit| Err("the places of a field are not measured".to_owned());
    let axis = match written.axis(name.as_str(), measured) {
        Ok(axis) => axis,
        Err(reason) => {
            complaints.at(&path).say(format!("the axis `{name}`: {reason}"));
            return None;
        }
    };
    if matches!(axis.coordinates, Coordinates::Labels(_)) {
        complaints.at(&path).say("a field has no labels").expected("an axis of numbers");
        return None;
    }
    if !(2..=MOST_PLACES).contains(&axis.len()) {
        complaints
            .at(&path)
            .say("the number of places of a field is limited")
            .expected(format!("2 to {MOST_PLACES} places"))
            .found(axis.len());
        return None;
    }
    Some(axis)
}

/// The number of terms that a section asks for; `None` after reporting an error.
fn keep(section: &FieldSection, places: usize, complaints: &mut Complaints<'_>) -> Option<Keep> {
    let path = format!("field.{}", section.name);
    match (section.terms, section.variance) {
        (Some(_), Some(_)) => {
            complaints
                .at(&format!("{path}.terms"))
                .say("`terms` and `variance` both say how many terms are kept")
                .help("take one of the two out");
            None
        }
        (Some(terms), None) if terms.get() > places => {
            complaints
                .at(&format!("{path}.terms"))
                .say("a field has no more terms than places")
                .expected(format!("at most {places}"))
                .found(terms.get());
            None
        }
        (Some(terms), None) => Some(Keep::Terms(terms.get())),
        (None, variance) => Some(Keep::Variance(variance.map_or(VARIANCE, OpenFraction::get))),
    }
}

/// The field of a section; `None` after reporting an error.
fn field(
    section: &FieldSection,
    directory: &Path,
    complaints: &mut Complaints<'_>,
) -> Option<Field> {
    let axis = axis(section, complaints)?;
    let Coordinates::Grid { values: at, unit: at_unit } = axis.coordinates else { return None };
    let keep = keep(section, at.len(), complaints);
    let (key, level, sd, log_normal) = match &section.distribution {
        FieldDistribution::Normal { mean, sd } => ("normal.mean", mean, sd.get(), false),
        FieldDistribution::LogNormal { median, sd } => {
            ("log_normal.median", median, sd.get(), true)
        }
    };
    let path = format!("field.{}.distribution.{key}", section.name);
    let level = match level.at(&at, &at_unit, &section.unit, directory) {
        Ok(level) => level,
        Err(reason) => {
            complaints.at(&path).say(reason);
            return None;
        }
    };
    if let Some(wrong) = level.iter().find(|y| !y.is_finite() || (log_normal && **y <= 0.0)) {
        let expected = if log_normal { "a number above zero" } else { "a finite number" };
        complaints
            .at(&path)
            .say(format!("no field has this {}", key.rsplit('.').next().unwrap_or_default()))
            .expected(expected)
            .found(wrong);
        return None;
    }
    let (kernel, length) = (section.kernel, section.length.get());
    let expansion = match Expansion::new(&at, |h| kernel.at(h / length), keep?) {
        Ok(expansion) => expansion,
        Err(error) => {
            let path = format!("field.{}.length", section.name);
            complaints.at(&path).say(format!("the covariance has no eigenvalues: {error}"));
            return None;
        }
    };
    let modes = Matrix::from_fn(expansion.values.len(), at.len(), |k, i| {
        sd * expansion.values[k].sqrt() * expansion.functions[(k, i)]
    });
    Some(Field {
        name: section.name.as_str().to_owned(),
        unit: section.unit.clone(),
        axis: axis.name,
        level: level.into_iter().map(|y| if log_normal { y.ln() } else { y }).collect(),
        at,
        at_unit,
        modes,
        sd,
        log_normal,
        kept: expansion.kept,
    })
}

impl Level {
    /// The values at these places, in a unit.
    fn at(
        &self,
        places: &[f64],
        place_unit: &Unit,
        unit: &Unit,
        directory: &Path,
    ) -> Result<Vec<f64>, String> {
        let section = match self {
            Self::Number(value) => return Ok(vec![*value; places.len()]),
            Self::Table(section) => section,
        };
        let table = section.read(TABLE, directory)?;
        let (at_unit, own) = (table.at_unit.clone(), table.unit.clone());
        let fault = |fault: Fault| fault.to_string();
        let mut scope = Scope::new();
        scope.unknown("x").map_err(fault)?;
        scope.function(table.into()).map_err(fault)?;
        scope.define("y", &format!("{TABLE}(x)")).map_err(fault)?;
        let faults = |faults: Vec<Fault>| faults.iter().map(Fault::to_string).collect::<String>();
        let program = scope.compile(&["y"]).map_err(faults)?;
        let mismatch = |what: &str, ours: &Unit, theirs: &Unit| {
            format!("the {what} of the table are in `{theirs}`, which does not convert to `{ours}`")
        };
        let interpolated = |x: &f64| {
            let x = place_unit.convert(*x, &at_unit);
            let x = x.ok_or_else(|| mismatch("places", place_unit, &at_unit))?;
            let value = own.convert(program.value(&[x])[0], unit);
            value.ok_or_else(|| mismatch("values", unit, &own))
        };
        places.iter().map(interpolated).collect()
    }
}

/// Adds fields to the conditions, and their coefficients to the parameters and their unknowns.
pub(super) fn enter(
    fields: &[Arc<Field>],
    scenarios: &mut [Scenario],
    (parameters, unknowns): (&mut Vec<Parameter>, &mut Vec<Unknown>),
) {
    for scenario in scenarios {
        scenario.fields = fields.to_vec();
    }
    for name in fields.iter().flat_map(|field| field.coefficients()) {
        parameters.push(Parameter::plain(&name, Distribution::Normal([0.0, 1.0])));
        unknowns.push(Unknown { kind: UnknownKind::Field, ..Unknown::shared(&name) });
    }
}

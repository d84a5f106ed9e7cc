//! `[[derived]]`: quantities computed from the parameters, reported like them.

use std::collections::BTreeMap;

use lacuna::data::Unit;
use lacuna::expression::{Data, Fault, Program, Scope};
use lacuna::text::values::Name;
use lacuna::text::{Complaints, Node, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::Quantity;
use super::plain::Study;

/// A quantity that follows from the parameters, such as a bulk modulus from density and sound speed. It gets a
/// posterior distribution, intervals and figures like a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DerivedSection {
    /// Name of the quantity.
    pub name: Name,
    /// Symbol used in figures. Default: the name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symbol: Option<String>,
    /// Expression of parameters, of values that `[model]` fixes and of other derived quantities, such as
    /// `"density * sound_speed^2"`; with `scenario`, of the parameters and values of that scenario.
    pub expression: String,
    /// Unit in which the quantity is reported. Default: the unit of the expression.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Scenario the quantity belongs to. `"each"` creates one quantity per scenario, called `name[scenario]`. Default:
    /// one quantity without a scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// Reference value from the literature or from practice, in the quantity's unit, to be compared with the posterior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

/// One derived quantity, ready to be computed.
#[derive(Debug, Clone)]
pub struct Derived {
    /// Name of the quantity, including that of its scenario: `name[scenario]`.
    pub name: String,
    /// Symbol used in figures.
    pub symbol: String,
    /// Unit of the value and the reference.
    pub unit: Unit,
    /// Reference value to compare with, in `unit`.
    pub reference: Option<f64>,
    /// The parameter of the study behind each unknown of the program.
    parameters: Vec<usize>,
    program: Program,
    factor: f64,
}

impl Derived {
    /// Value of the quantity, in `unit`, at a point of the study's parameters (one value per parameter, in the study's
    /// order and units).
    pub fn value(&self, point: &[f64]) -> f64 {
        let unknowns: Vec<f64> = self.parameters.iter().map(|&i| point[i]).collect();
        self.program.value(&unknowns)[0] * self.factor
    }
}

/// The names that an expression may use, their units, and the parameters behind the unknowns.
type Known = (Scope, BTreeMap<String, Unit>, Vec<usize>);

/// An error in a derived quantity.
enum Wrong {
    /// The study has no scenario of this name.
    Scenario(String),
    /// A fault in an expression.
    Fault(Fault),
    /// The requested unit does not convert to the expression's unit, which is given.
    Unit(Unit),
}

impl Study {
    /// Derived quantities of a checked study, in the order of the study.
    pub fn derived(&self) -> Vec<Derived> {
        let all = self.derived_sections.iter();
        all.filter_map(|section| derive(self, section).ok()).flatten().collect()
    }
}

/// Quantities that one section defines: one, or one per scenario.
fn derive(study: &Study, section: &DerivedSection) -> Result<Vec<Derived>, Vec<Wrong>> {
    let Some(scenario) = &section.scenario else {
        return Ok(vec![derive_in(study, section, None)?]);
    };
    let named = |i: &usize| study.scenarios[*i].label().is_some_and(|name| name == scenario);
    let every = 0..study.scenarios.len();
    let chosen: Vec<usize> = match every.clone().find(named) {
        Some(place) => vec![place],
        None if scenario == "each" && study.scenarios[0].label().is_some() => every.collect(),
        None => return Err(vec![Wrong::Scenario(scenario.clone())]),
    };
    chosen.into_iter().map(|place| derive_in(study, section, Some(place))).collect()
}

fn derive_in(
    study: &Study,
    section: &DerivedSection,
    scenario: Option<usize>,
) -> Result<Derived, Vec<Wrong>> {
    let faults = |faults: Vec<Fault>| faults.into_iter().map(Wrong::Fault).collect::<Vec<_>>();
    let name = section.name.as_str();
    let (scope, units, parameters) =
        scope(study, name, scenario).map_err(|fault| faults(vec![fault]))?;
    let program = scope.compile(&[name]).map_err(faults)?;
    let found = scope.check_units(&units).map_err(faults)?;
    let own = found.get(name).cloned().unwrap_or_default();
    let unit = section.unit.clone().unwrap_or_else(|| own.clone());
    let factor = own.factor_to(&unit).ok_or_else(|| vec![Wrong::Unit(own)])?;
    let full = |base: &str| match scenario {
        Some(i) => format!("{base}[{}]", study.scenarios[i].name),
        None => base.to_owned(),
    };
    let symbol = full(section.symbol.as_deref().unwrap_or(name));
    let reference = section.reference;
    Ok(Derived { name: full(name), symbol, unit, reference, parameters, program, factor })
}

/// The derived quantities on which one of them depends, itself included.
fn needed<'s>(study: &'s Study, name: &str) -> Vec<&'s DerivedSection> {
    let find = |name: &str| study.derived_sections.iter().find(|s| s.name.as_str() == name);
    let mut needed: Vec<&DerivedSection> = find(name).into_iter().collect();
    let mut next = 0;
    while let Some(section) = needed.get(next) {
        let fields: Vec<&str> = study.fields.iter().map(|field| field.name.as_str()).collect();
        for used in lacuna::expression::names(&section.expression, &fields).unwrap_or_default() {
            let more = find(&used).filter(|s| !needed.iter().any(|n| n.name == s.name));
            needed.extend(more);
        }
        next += 1;
    }
    needed
}

/// Names that the expression of a derived quantity may use; `scenario` is the index of its scenario, if it has one.
fn scope(study: &Study, name: &str, scenario: Option<usize>) -> Result<Known, Fault> {
    let mut scope = Scope::new();
    let (mut units, mut parameters) = (BTreeMap::new(), Vec::new());
    for field in &study.fields {
        scope.field(field.clone())?;
    }
    for (i, unknown) in study.unknowns.iter().enumerate() {
        if unknown.is_known_in(scenario) {
            scope.unknown(&unknown.name)?;
            units.insert(unknown.name.clone(), study.parameters[i].unit.clone());
            parameters.push(i);
        }
    }
    let mut known: BTreeMap<String, Quantity> =
        study.model.as_ref().map(|model| model.common.fixed.clone()).unwrap_or_default();
    for condition in scenario.into_iter().flat_map(|i| &study.scenarios[i].values) {
        let quantity = Quantity { value: condition.value, unit: condition.unit.clone() };
        known.insert(condition.name.clone(), quantity);
    }
    for (name, quantity) in known {
        scope.data(&name, Data::Number(quantity.value))?;
        units.extend(quantity.unit.map(|unit| (name, unit)));
    }
    for other in needed(study, name) {
        let usable = other.scenario.is_none() || scenario.is_some();
        if usable {
            scope.define(other.name.as_str(), &other.expression)?;
        }
    }
    Ok((scope, units, parameters))
}

/// Reports errors in the derived quantities.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let mut said: Vec<Fault> = Vec::new();
    for (i, section) in study.derived_sections.iter().enumerate() {
        if study.derived_sections[..i].iter().any(|other| other.name == section.name) {
            Complaints::new(root, problems)
                .at(&format!("derived.{}.name", section.name))
                .say(format!("there are two derived quantities `{}`", section.name))
                .help("give each `[[derived]]` its own name");
        }
        let Err(wrongs) = derive(study, section) else { continue };
        for wrong in wrongs {
            let mut complaints = Complaints::new(root, problems);
            let path = format!("derived.{}", section.name);
            match wrong {
                Wrong::Scenario(name) => {
                    complaints
                        .at(&format!("{path}.scenario"))
                        .say(format!("there is no scenario `{name}`"))
                        .expected(
                            "the name of a `[[scenario]]`, or \"each\" in a study that has some",
                        );
                }
                Wrong::Unit(own) => {
                    complaints
                        .at(&format!("{path}.unit"))
                        .say(format!("the expression of `{}` has another unit", section.name))
                        .expected(format!("a unit that converts to `{own}`"))
                        .found(section.unit.as_ref().map_or(String::new(), |u| format!("`{u}`")));
                }
                Wrong::Fault(fault) if !said.contains(&fault) => {
                    said.push(fault.clone());
                    let path = match fault.definition.as_str() {
                        "" => format!("{path}.name"),
                        name => format!("derived.{name}.expression"),
                    };
                    let problem = complaints.at(&path).inside(fault.span).say(fault.message);
                    problem.expected = fault.expected.map(String::from);
                    problem.found = fault.found.map(String::from);
                    problem.help.extend(fault.help.map(String::from));
                }
                Wrong::Fault(_) => {}
            }
        }
    }
}

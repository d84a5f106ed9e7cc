//! `[[derived]]`: quantities computed from the parameters, reported like them.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::Quantity;
use super::resolve::Study;
use super::values::Name;
use super::{Complaints, Node, Problems};
use crate::data::Unit;
use crate::expression::{Data, Fault, Program, Scope};

/// A quantity that follows from the parameters, such as a bulk modulus from density and sound speed. It gets a
/// posterior, intervals and pictures like a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DerivedSection {
    /// Its name.
    pub name: Name,
    /// The symbol used in figures; the name when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symbol: Option<String>,
    /// What it is, as an expression of parameters, of values that `[model]` fixes and of other derived quantities, such
    /// as `"density * sound_speed^2"`; of one scenario's parameters and values where `scenario` is given.
    pub expression: String,
    /// The unit in which it is wanted; that of the expression when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The scenario to which it belongs; `"each"` makes one a scenario, called `name[scenario]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// A value from the literature or from practice, to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

/// One derived quantity, ready to be computed.
#[derive(Debug, Clone)]
pub struct Derived {
    /// Its name, that of its scenario included.
    pub name: String,
    /// Its symbol.
    pub symbol: String,
    /// Its unit.
    pub unit: Unit,
    /// A value to compare with.
    pub reference: Option<f64>,
    /// The parameter of the study behind each unknown of the program.
    parameters: Vec<usize>,
    program: Program,
    factor: f64,
}

impl Derived {
    /// Its value at a point of the study's parameters.
    pub fn value(&self, point: &[f64]) -> f64 {
        let unknowns: Vec<f64> = self.parameters.iter().map(|&i| point[i]).collect();
        self.program.value(&unknowns)[0] * self.factor
    }
}

/// The names that an expression may use, their units, and the parameters behind the unknowns.
type Known = (Scope, BTreeMap<String, Unit>, Vec<usize>);

/// What is wrong with a derived quantity.
pub(super) enum Wrong {
    /// Its scenario is none.
    Scenario(String),
    /// The expression of the section of this name.
    Fault(Fault),
    /// Its unit, and the unit of the expression.
    Unit(Unit),
}

impl Study {
    /// The derived quantities of a study that was checked.
    pub fn derived(&self) -> Vec<Derived> {
        let all = self.derived_sections.iter();
        all.filter_map(|section| self.derive(section).ok()).flatten().collect()
    }

    /// The quantities that one section makes.
    pub(super) fn derive(&self, section: &DerivedSection) -> Result<Vec<Derived>, Vec<Wrong>> {
        let Some(scenario) = &section.scenario else {
            return Ok(vec![self.derive_in(section, None)?]);
        };
        let named = |i: &usize| self.scenarios[*i].label().is_some_and(|name| name == scenario);
        let every = 0..self.scenarios.len();
        let chosen: Vec<usize> = match every.clone().find(named) {
            Some(place) => vec![place],
            None if scenario == "each" && self.scenarios[0].label().is_some() => every.collect(),
            None => return Err(vec![Wrong::Scenario(scenario.clone())]),
        };
        chosen.into_iter().map(|place| self.derive_in(section, Some(place))).collect()
    }

    fn derive_in(
        &self,
        section: &DerivedSection,
        scenario: Option<usize>,
    ) -> Result<Derived, Vec<Wrong>> {
        let faults = |faults: Vec<Fault>| faults.into_iter().map(Wrong::Fault).collect::<Vec<_>>();
        let name = section.name.as_str();
        let (scope, units, parameters) =
            self.scope(name, scenario).map_err(|fault| faults(vec![fault]))?;
        let program = scope.compile(&[name]).map_err(faults)?;
        let found = scope.check_units(&units).map_err(faults)?;
        let own = found.get(name).cloned().unwrap_or_default();
        let unit = section.unit.clone().unwrap_or_else(|| own.clone());
        let factor = own.factor_to(&unit).ok_or_else(|| vec![Wrong::Unit(own)])?;
        let full = |base: &str| match scenario {
            Some(i) => format!("{base}[{}]", self.scenarios[i].name),
            None => base.to_owned(),
        };
        let symbol = full(section.symbol.as_deref().unwrap_or(name));
        let reference = section.reference;
        Ok(Derived { name: full(name), symbol, unit, reference, parameters, program, factor })
    }

    /// The derived quantities on which one of them depends, itself included.
    fn needed(&self, name: &str) -> Vec<&DerivedSection> {
        let find = |name: &str| self.derived_sections.iter().find(|s| s.name.as_str() == name);
        let mut needed: Vec<&DerivedSection> = find(name).into_iter().collect();
        let mut next = 0;
        while let Some(section) = needed.get(next) {
            for used in crate::expression::names(&section.expression, &[]).unwrap_or_default() {
                let more = find(&used).filter(|s| !needed.iter().any(|n| n.name == s.name));
                needed.extend(more);
            }
            next += 1;
        }
        needed
    }

    /// What a derived quantity may use.
    fn scope(&self, name: &str, scenario: Option<usize>) -> Result<Known, Fault> {
        let mut scope = Scope::new();
        let (mut units, mut parameters) = (BTreeMap::new(), Vec::new());
        for (i, unknown) in self.unknowns.iter().enumerate() {
            if unknown.scenario.is_none() || unknown.scenario == scenario {
                scope.unknown(&unknown.name)?;
                units.insert(unknown.name.clone(), self.parameters[i].unit.clone());
                parameters.push(i);
            }
        }
        let mut known: BTreeMap<String, Quantity> =
            self.model.as_ref().map(|model| model.common.fixed.clone()).unwrap_or_default();
        for condition in scenario.into_iter().flat_map(|i| &self.scenarios[i].values) {
            let quantity = Quantity { value: condition.value, unit: condition.unit.clone() };
            known.insert(condition.name.clone(), quantity);
        }
        for (name, quantity) in known {
            scope.data(&name, Data::Number(quantity.value))?;
            units.extend(quantity.unit.map(|unit| (name, unit)));
        }
        for other in self.needed(name) {
            let usable = other.scenario.is_none() || scenario.is_some();
            if usable {
                scope.define(other.name.as_str(), &other.expression)?;
            }
        }
        Ok((scope, units, parameters))
    }
}

/// Reports what is wrong with the derived quantities.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let mut said: Vec<Fault> = Vec::new();
    for (i, section) in study.derived_sections.iter().enumerate() {
        if study.derived_sections[..i].iter().any(|other| other.name == section.name) {
            Complaints::new(root, problems)
                .at(&format!("derived.{}.name", section.name))
                .say(format!("there are two derived quantities `{}`", section.name))
                .help("give each `[[derived]]` its own name");
        }
        let Err(wrongs) = study.derive(section) else { continue };
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

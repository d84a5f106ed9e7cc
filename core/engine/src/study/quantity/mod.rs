//! `[[quantity]]`: quantities of interest, predicted from the posterior.

mod curves;

use lacuna::data::Unit;
use lacuna::data::layouts::SCENARIO;
use lacuna::expression::is_name;
use lacuna::plugin::Quantity;
use lacuna::plugin::effect::On;
use lacuna::plugin::quantity::{Arguments, Curve, Functional, Misfit, Number};
use lacuna::plugin::registry::Section;
use lacuna::text::quantity;
use lacuna::text::values::Name;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::curves::{curves, window};
use super::derived::Derived;
use super::plain::Study;

/// The engine's keys of `[[quantity]]`: a quantity of interest, which is predicted with its uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct QuantityKeys {
    /// Name of the quantity. A response of several curves has one value per curve, with the labels of the curve in its
    /// name: `damage_R` for sensor `R`. In a study with scenarios the name ends with that of the scenario:
    /// `damage_R[hot]`.
    pub name: Name,
    /// Curves of which the quantity is taken: labels by axis, such as `{ sensor = ["R", "V"], scenario = ["hot"] }`.
    /// Default: all.
    #[serde(default, skip_serializing_if = "On::is_empty")]
    pub on: On,
    /// Part of the curve along the last axis that is used: first and last point, as numbers in the unit of the axis, or
    /// with a unit as in `[{ value = 0.1, unit = "ms" }, { value = 0.8, unit = "ms" }]`. Points of the curve on the ends
    /// belong to it. Default: the whole curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<[quantity::Quantity; 2]>,
    /// Unit in which the quantity is reported. Default: the unit that follows from the response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Reference value from the literature or from practice, in the quantity's unit, to be compared with the prediction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
    /// Errors that the prediction contains besides the uncertainty of the parameters. Default:
    /// `["emulator", "numerics", "model_form"]`, the uncertainty of the true response. With `measurement` it is that of a
    /// new measured record, whose noise raises maxima and the number of cycles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub include: Option<Vec<Included>>,
}

/// Error of a prediction, by its origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Included {
    /// The error of the emulator that replaces the model.
    Emulator,
    /// The model's numerical error.
    Numerics,
    /// The part of the discrepancy beyond the scatter between replicates: the error of the model's form.
    ModelForm,
    /// The scatter of a new replicate: noise of the measuring chain and what differs from pulse to pulse.
    Measurement,
    /// A discrepancy that cannot be separated into the two, because there are no replicates.
    Discrepancy,
    /// Errors of other names, which the discrepancy of a library may state.
    Other,
}

/// Errors that a prediction of the true response contains.
const DEFAULT: [Included; 3] = [Included::Emulator, Included::Numerics, Included::ModelForm];

impl Included {
    fn of(origin: &str) -> Self {
        match origin {
            "emulator" => Self::Emulator,
            "numerics" => Self::Numerics,
            "model_form" => Self::ModelForm,
            "measurement" => Self::Measurement,
            "discrepancy" => Self::Discrepancy,
            _ => Self::Other,
        }
    }
}

/// Returns true if predictions contain errors of this origin unless the study says otherwise.
pub fn in_default(origin: &str) -> bool {
    DEFAULT.contains(&Included::of(origin))
}

/// One value that a study asks for, ready to be computed.
pub struct Asked {
    /// Name with the labels of its curve and its scenario.
    pub name: String,
    /// Unit of the value and the reference.
    pub unit: Unit,
    /// Reference value to compare with, in `unit`.
    pub reference: Option<f64>,
    /// True for a value of a curve; false for one of numbers.
    pub of_curve: bool,
    include: Vec<Included>,
    /// Name without the scenario, and the index of the scenario.
    base: String,
    scenario: Option<usize>,
    arguments: Sources,
    functional: Box<dyn Functional>,
}

/// Sources of the arguments of a quantity.
enum Sources {
    /// Outputs of all scenarios.
    Outputs(Vec<usize>),
    /// Numbers.
    Numbers(Vec<Source>),
}

/// True for each of the values asked for that one of them needs: itself, and those from which it is computed.
pub fn needed(asked: &[Asked], value: usize) -> Vec<bool> {
    let mut needed = vec![false; asked.len()];
    needed[value] = true;
    for i in (0..=value).rev() {
        if needed[i] {
            asked[i].earlier().into_iter().for_each(|before| needed[before] = true);
        }
    }
    needed
}

/// Source of one number.
#[derive(Debug, Clone, Copy)]
enum Source {
    Parameter(usize),
    Known(f64),
    Derived(usize),
    Asked(usize),
}

impl Asked {
    /// Returns true if the prediction contains an error of this origin.
    pub fn includes(&self, origin: &str) -> bool {
        self.include.contains(&Included::of(origin))
    }

    /// Indices of the outputs of the response that the value is computed from; empty for one of numbers.
    pub fn outputs(&self) -> &[usize] {
        match &self.arguments {
            Sources::Outputs(outputs) => outputs,
            Sources::Numbers(_) => &[],
        }
    }

    /// Indices of the values asked for before this one that it is computed from.
    fn earlier(&self) -> Vec<usize> {
        let index = |source: &Source| match *source {
            Source::Asked(i) => Some(i),
            _ => None,
        };
        match &self.arguments {
            Sources::Outputs(_) => Vec::new(),
            Sources::Numbers(sources) => sources.iter().filter_map(index).collect(),
        }
    }

    /// Value in `unit`: from the response with its errors, at one output after the other, or from a point of the study's
    /// parameters, the derived quantities there, and the values asked for before this one.
    pub fn value(
        &self,
        response: impl Fn(usize) -> f64,
        (point, derived, before): (&[f64], &[f64], &[f64]),
    ) -> f64 {
        let arguments: Vec<f64> = match &self.arguments {
            Sources::Outputs(outputs) => outputs.iter().map(|&i| response(i)).collect(),
            Sources::Numbers(sources) => {
                let one = |source: &Source| match *source {
                    Source::Parameter(i) => point[i],
                    Source::Known(value) => value,
                    Source::Derived(i) => derived[i],
                    Source::Asked(i) => before[i],
                };
                sources.iter().map(one).collect()
            }
        };
        let value = self.functional.value(&arguments);
        self.functional.unit().convert(value, &self.unit).unwrap_or(f64::NAN)
    }
}

/// A section `[[quantity]]`.
pub type QuantitySection = Section<dyn Quantity, QuantityKeys>;

impl Study {
    /// The values that a checked study asks for: those of curves first, then those of numbers, each in the order of the
    /// study. A value uses only those before it.
    pub fn asked(&self) -> Vec<Asked> {
        asked(self).0
    }
}

/// The values that a study asks for, and the misfits of each section, by its index. A quantity of a library that was not
/// loaded has neither, and then nothing is said of quantities of numbers, which may use it; the flag is true if there is none.
pub(super) fn asked(study: &Study) -> (Vec<Asked>, Vec<(usize, Misfit)>, bool) {
    let (mut all, mut misfits): (Vec<Asked>, Vec<(usize, Misfit)>) = Default::default();
    let derived = study.derived();
    let mut is_known = true;
    for of_curve in [true, false] {
        for (i, section) in study.quantities.iter().enumerate() {
            if section.built.plugin.of_curve() != of_curve || !(of_curve || is_known) {
                continue;
            }
            let found = if of_curve {
                of_curves(study, section)
            } else {
                of_numbers(study, section, &derived, &all)
            };
            match found {
                Ok(more) => {
                    for asked in more {
                        let taken = |name: &String| *name == asked.name;
                        if all.iter().map(|other| &other.name).any(taken)
                            || study.parameters.iter().map(|p| &p.name).any(taken)
                            || derived.iter().map(|d| &d.name).any(taken)
                        {
                            let message = format!("there are two of the name `{}`", asked.name);
                            let help = "give the quantity a name of its own";
                            misfits.push((i, Misfit::new("name", message).help(help)));
                        }
                        all.push(asked);
                    }
                }
                Err(found) => {
                    is_known &= !found.is_empty();
                    misfits.extend(found.into_iter().map(|misfit| (i, misfit)));
                }
            }
        }
    }
    (all, misfits, is_known)
}

/// Indices of the scenarios that a section selects.
fn scenarios<'s>(study: &'s Study, keys: &'s QuantityKeys) -> impl Iterator<Item = usize> + 's {
    let chosen = keys.on.get(SCENARIO);
    let selected = move |i: &usize| chosen.is_none_or(|c| c.contains(&study.scenarios[*i].name));
    (0..study.scenarios.len()).filter(selected)
}

/// Values of a quantity of curves, one per curve and scenario.
fn of_curves(study: &Study, section: &QuantitySection) -> Result<Vec<Asked>, Vec<Misfit>> {
    let keys = &section.common;
    if study.target.is_some() {
        let misfit = Misfit::new("use", "a study with `[target]` has no response");
        return Err(vec![misfit.expected("a quantity of numbers, such as an expression")]);
    }
    let mut all = Vec::new();
    for s in scenarios(study, keys) {
        let scenario = &study.scenarios[s];
        let Some((layout, range)) = study.layouts.of_scenario(&scenario.name) else { continue };
        for curve in curves(&layout, &keys.on) {
            let (grid, grid_unit) = (curve.grid, curve.grid_unit);
            let kept = window(keys, grid, grid_unit)?;
            let part: Vec<f64> = kept.iter().map(|&k| grid[k]).collect();
            let arguments = Arguments::Curve(Curve {
                name: &layout.name,
                unit: &layout.unit,
                axis: curve.axis,
                grid: &part,
                grid_unit,
            });
            let outputs = kept.iter().map(|&k| range.start + curve.outputs[k]).collect();
            let base = [keys.name.as_str(), &curve.labels].concat();
            let place = (base, scenario.label().map(|_| s));
            all.push(ready(study, section, place, &arguments, Sources::Outputs(outputs))?);
        }
    }
    if all.is_empty() && !keys.on.is_empty() {
        return Err(vec![Misfit::new("on", "no curve is selected")]);
    }
    if all.is_empty() {
        let message = "the response has no axis of numbers, along which curves have values";
        return Err(vec![Misfit::new("use", message)]);
    }
    Ok(all)
}

/// Values of a quantity of numbers: one, or one per scenario if it is written for some or uses numbers of a scenario.
fn of_numbers(
    study: &Study,
    section: &QuantitySection,
    derived: &[Derived],
    before: &[Asked],
) -> Result<Vec<Asked>, Vec<Misfit>> {
    let keys = &section.common;
    let useless = [
        ("on", keys.on.keys().any(|axis| axis != SCENARIO)),
        ("window", keys.window.is_some()),
        ("include", keys.include.is_some()),
    ];
    if let Some((key, _)) = useless.iter().find(|(_, there)| *there) {
        let misfit = Misfit::new(key, "a quantity of numbers has no curve");
        return Err(vec![misfit.help(format!("state `{key}` in the quantities that it uses"))]);
    }
    let make = |scenario: Option<usize>| {
        let named = numbers(study, derived, before, scenario);
        let arguments: Vec<Number<'_>> =
            named.iter().map(|n| Number { name: &n.name, unit: n.unit.as_ref() }).collect();
        let sources = Sources::Numbers(named.iter().map(|n| n.source).collect());
        let place = (keys.name.as_str().to_owned(), scenario);
        ready(study, section, place, &Arguments::Numbers(&arguments), sources)
    };
    let labelled = study.scenarios.iter().any(|scenario| scenario.label().is_some());
    if keys.on.is_empty() {
        let whole = make(None).map(|one| vec![one]);
        if whole.is_ok() || !labelled {
            return whole;
        }
    }
    scenarios(study, keys).map(|scenario| make(Some(scenario))).collect()
}

/// A number that a quantity may use.
struct Named {
    name: String,
    unit: Option<Unit>,
    source: Source,
}

/// The numbers of a scenario, or those that belong to none.
fn numbers(
    study: &Study,
    derived: &[Derived],
    before: &[Asked],
    scenario: Option<usize>,
) -> Vec<Named> {
    let mut all: Vec<Named> = Vec::new();
    let mut add = |name: &str, unit: Option<Unit>, source: Source| {
        if is_name(name) && all.iter().all(|other| other.name != name) {
            all.push(Named { name: name.to_owned(), unit, source });
        }
    };
    for (i, unknown) in study.unknowns.iter().enumerate() {
        if unknown.is_known_in(scenario) {
            let unit = study.parameters[i].unit.clone();
            add(&unknown.name, Some(unit), Source::Parameter(i));
        }
    }
    for condition in scenario.into_iter().flat_map(|s| &study.scenarios[s].values) {
        add(&condition.name, condition.unit.clone(), Source::Known(condition.value));
    }
    for (name, value) in study.model.iter().flat_map(|model| &model.common.fixed) {
        add(name, value.unit.clone(), Source::Known(value.value));
    }
    let suffix = scenario.map(|s| format!("[{}]", study.scenarios[s].name)).unwrap_or_default();
    for (i, quantity) in derived.iter().enumerate() {
        let name = quantity.name.strip_suffix(&suffix).unwrap_or(&quantity.name);
        add(name, Some(quantity.unit.clone()), Source::Derived(i));
    }
    for (i, asked) in before.iter().enumerate() {
        if asked.scenario.is_none() || asked.scenario == scenario {
            add(&asked.base, Some(asked.unit.clone()), Source::Asked(i));
        }
    }
    all
}

/// One value with its plugin bound to its arguments.
fn ready(
    study: &Study,
    section: &QuantitySection,
    (base, scenario): (String, Option<usize>),
    arguments: &Arguments<'_>,
    sources: Sources,
) -> Result<Asked, Vec<Misfit>> {
    let keys = &section.common;
    let functional = section.built.plugin.bind(arguments)?;
    let own = functional.unit();
    let unit = keys.unit.clone().unwrap_or_else(|| own.clone());
    if own.convert(1.0, &unit).is_none() {
        let misfit = Misfit::new("unit", format!("`{}` has another unit", keys.name.as_str()));
        let expected = format!("a unit that converts to `{own}`");
        return Err(vec![misfit.expected(expected).found(format!("`{unit}`"))]);
    }
    let suffix = scenario.map(|s| format!("[{}]", study.scenarios[s].name));
    Ok(Asked {
        name: [base.as_str(), suffix.as_deref().unwrap_or_default()].concat(),
        unit,
        reference: keys.reference,
        of_curve: section.built.plugin.of_curve(),
        include: keys.include.clone().unwrap_or_else(|| DEFAULT.to_vec()),
        base,
        scenario,
        arguments: sources,
        functional,
    })
}

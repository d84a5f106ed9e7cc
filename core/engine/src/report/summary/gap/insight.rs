//! The keys of the further results of a search.

use schemars::JsonSchema;
use serde::Serialize;

use crate::gap::drift::{DriftLevel, DriftMap};
use crate::gap::next::{NextData, NextOption as FoundOption, Wanted};
use crate::gap::result::insight::Insight as Found;
use crate::gap::search::{CrossValidation, Discrimination};
use crate::report::summary::value::{ByName, Quantity};

/// Further results of the gap search; all empty if nothing is missing.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Insight {
    /// Cross-validation of the best explanation against its rival, one entry per way of leaving data out.
    pub foretold: Vec<CrossValidation>,
    /// Rival of the best explanation: a type, or `nothing`; `null` if nothing is missing.
    pub against: Option<String>,
    /// Comparison of the parameters between conditions and windows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// Further measurements that would discriminate between the members of a class.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub separations: Option<Discrimination>,
    /// Bits that further data are expected to give (`lacuna next STUDY`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next: Option<Next>,
    /// Places in words at which an unlisted effect acts.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<String>,
    /// Symbolic form of an unlisted effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub symbolic: Option<Symbolic>,
    /// Smoother (a Gaussian process) in place of an unlisted effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopgap: Option<Process>,
}

/// Information that further data are expected to give.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Next {
    /// Types that the name may be, and `none of these`, with their posterior probabilities; empty if there is no choice.
    #[schemars(extend("propertyNames" = { "title": "type" }))]
    pub names: ByName<Quantity>,
    /// Purpose by which the options are ranked, per cost: the name if there is a choice, or else the quantity if the study states
    /// one, or else the parameters.
    pub ranked_by: Wanted,
    /// Options, best first.
    pub options: Vec<NextOption>,
    /// Names of the options that measure nothing: no curve of the response has their scenario, labels and interval.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without_data: Vec<String>,
}

/// Data that could be taken, with the information expected from them.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NextOption {
    /// Name of the option, as the study states it, or what is taken, in words.
    pub name: String,
    /// Cost.
    pub cost: Quantity,
    /// Expected bits on the name of what is missing.
    pub name_bits: Quantity,
    /// Monte Carlo standard error of `name_bits`.
    pub name_error: f64,
    /// Expected bits on the parameters of the model.
    pub parameter_bits: Quantity,
    /// Expected bits on the quantity of `[gap.quantity]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity_bits: Option<Quantity>,
    /// Monte Carlo standard error of `quantity_bits`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity_error: Option<f64>,
    /// True if the difference to the first option is at most two Monte Carlo standard errors.
    pub equal_to_best: bool,
}

/// Comparison of the parameters between conditions and windows, each calibrated alone and without effects.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Drift {
    /// Level at which something is missing.
    pub reading: DriftLevel,
    /// Level at which something is missing, in words.
    pub words: String,
    /// p-value of the test that all parameters are equal in all conditions and windows.
    pub p: f64,
    /// p-value of the test that the parameter is equal in all conditions and windows, while the others may differ.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub parameters: ByName<f64>,
}

/// Symbolic form of an unlisted effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Symbolic {
    /// Term that is added to the response, in the language of expressions: `y` is the response, `t` the place on the
    /// last axis, `dy` and `ddy` the derivatives of `y` along it; `[a, b]` has one coefficient per sensor.
    pub form: String,
    /// Share of the misfit beyond noise that the form explains, minus the share that it would explain of noise alone.
    pub explained: Quantity,
}

/// Smoother: a Gaussian process in place of an unlisted effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Process {
    /// Share of the misfit beyond noise that the process explains, minus the share that it would explain of noise
    /// alone.
    pub explained: Quantity,
    /// Correlation length, in the unit of the last axis.
    pub length: Quantity,
}

impl Insight {
    pub fn of(found: &Found) -> Self {
        Self {
            foretold: found.cross_validation.clone(),
            against: found.against.clone(),
            drift: found.drift.as_ref().map(Drift::of),
            separations: found.discrimination.clone(),
            next: found.next.as_ref().map(Next::of),
            places: found.places.iter().map(|place| place.words.clone()).collect(),
            symbolic: found.symbolic.as_ref().map(|symbolic| Symbolic {
                form: symbolic.form.clone(),
                explained: symbolic.explained.into(),
            }),
            stopgap: found.smoother.as_ref().map(|smoother| Process {
                explained: smoother.explained.into(),
                length: smoother.length.into(),
            }),
        }
    }
}

impl Next {
    fn of(found: &NextData) -> Self {
        let option = |own: &FoundOption| NextOption {
            name: own.name.clone(),
            cost: own.cost.into(),
            name_bits: own.name_bits.into(),
            name_error: own.name_error,
            parameter_bits: own.parameter_bits.into(),
            quantity_bits: own.quantity_bits.map(Quantity::from),
            quantity_error: own.quantity_error,
            equal_to_best: own.equal_to_best,
        };
        let names = found.hypotheses.iter().map(|own| (own.kind.clone(), own.weight.into()));
        Self {
            names: names.collect(),
            ranked_by: found.ranked_by,
            options: found.options.iter().map(option).collect(),
            without_data: found.without_data.clone(),
        }
    }
}

impl Drift {
    fn of(map: &DriftMap) -> Self {
        Self {
            reading: map.reading.clone(),
            words: map.words.clone(),
            p: map.all.p,
            parameters: map.parameters.iter().map(|p| (p.name.clone(), p.equality.p)).collect(),
        }
    }
}

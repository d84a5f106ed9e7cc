//! The study whose runs train the emulator of a study with parameters by group.
//!
//! The model has one value of each parameter, whatever the group. Its runs vary these values and are made once for all
//! scenarios whose conditions, functions and axes are equal.

use std::collections::BTreeMap;
use std::ops::Range;

use lacuna::data::{Layouts, Parameter, Scenario};
use lacuna::text::{Node, Problems};
use serde::Serialize;

use crate::study::fidelity;
use crate::study::gap::Gap;
use crate::study::plain::{Parts, Study};
use crate::study::table::PluginSections;
use crate::study::unknowns::Unknown;

/// See the module.
pub struct Trained {
    /// Parameters, conditions and responses of the runs, with the plugins that make them and learn from them.
    pub study: Box<Study>,
    /// For each set of values with which the emulator is evaluated: where they are taken from, and where the response goes.
    pub parts: Vec<Part>,
}

/// One evaluation of the emulator.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Part {
    /// Place among the parameters of the study of each parameter of the runs.
    pub parameters: Vec<usize>,
    /// Ranges of outputs of the runs, each with the range of outputs of the study to which it is copied.
    pub outputs: Vec<(Range<usize>, Range<usize>)>,
}

impl Trained {
    /// Number of scenarios whose runs are made.
    pub fn conditions(&self) -> usize {
        self.study.scenarios.len()
    }
}

/// The study that is trained; `None` if it is the study itself: without a surrogate or without parameters by group.
pub(in crate::study) fn trained(study: &Study, root: &Node) -> Option<Trained> {
    let grouped = study.unknowns.iter().any(|unknown| unknown.member.is_some());
    if study.surrogate.is_none() || !grouped {
        return None;
    }
    let (parameters, unknowns) = inputs(study);
    let (scenarios, kinds) = kinds(study);
    let layouts = layouts(study, &scenarios)?;
    let names: Vec<&str> = unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
    let mut parts: Vec<Part> = Vec::new();
    for (place, scenario) in study.scenarios.iter().enumerate() {
        let (_, to) = study.layouts.of_scenario(&scenario.name)?;
        let (_, from) = layouts.of_scenario(&scenarios[kinds[place]].name)?;
        let of =
            |name: &&str| study.unknowns.iter().position(|u| u.name == **name && u.acts_in(place));
        let own: Vec<usize> = names.iter().map(of).collect::<Option<_>>()?;
        match parts.iter_mut().find(|part| part.parameters == own) {
            Some(part) => part.outputs.push((from, to)),
            None => parts.push(Part { parameters: own, outputs: vec![(from, to)] }),
        }
    }
    let scenarios = scenarios.into_iter().map(|scenario| Scenario {
        labels: BTreeMap::new(),
        unmeasured: false,
        ..scenario.clone()
    });
    let scenarios = scenarios.collect();
    let trained = alone(study, (parameters, unknowns), scenarios, layouts, root);
    Some(Trained { study: Box::new(trained), parts })
}

/// The parameters of the runs: each name once.
fn inputs(study: &Study) -> (Vec<Parameter>, Vec<Unknown>) {
    let (mut parameters, mut unknowns): (Vec<Parameter>, Vec<Unknown>) = Default::default();
    for (parameter, unknown) in study.parameters.iter().zip(&study.unknowns) {
        let known = unknowns.iter().any(|other| other.name == unknown.name);
        if known || unknown.of_population() {
            continue;
        }
        let mut own = parameter.clone();
        if let Some(member) = &unknown.member {
            let suffix = format!("[{}]", member.group);
            own.name.clone_from(&unknown.name);
            if let Some(plain) = own.symbol.strip_suffix(&suffix) {
                own.symbol = String::from(plain);
            }
            own.prior = own.design.clone();
        }
        parameters.push(own);
        unknowns.push(Unknown { member: None, ..unknown.clone() });
    }
    (parameters, unknowns)
}

/// One scenario of each kind of conditions, and the kind of each scenario. A single kind has no name.
fn kinds(study: &Study) -> (Vec<Scenario>, Vec<usize>) {
    let mut first: Vec<&Scenario> = Vec::new();
    let shape = |scenario: &Scenario| study.layouts.of_scenario(&scenario.name).map(|of| of.0);
    let mut kinds = Vec::new();
    for scenario in &study.scenarios {
        let alike = |other: &&&Scenario| {
            let of = |s: &Scenario| (s.values.clone(), s.functions.clone());
            of(other) == of(scenario) && shape(other) == shape(scenario)
        };
        let place = first.iter().position(|other| alike(&other)).unwrap_or_else(|| {
            first.push(scenario);
            first.len() - 1
        });
        kinds.push(place);
    }
    (first.into_iter().cloned().collect(), kinds)
}

/// Shapes of the responses to the runs; a single kind of conditions has no axis of scenarios.
fn layouts(study: &Study, scenarios: &[Scenario]) -> Option<Layouts> {
    let shape = |scenario: &Scenario| Some(study.layouts.of_scenario(&scenario.name)?.0);
    if let [alone] = scenarios {
        return shape(alone).map(Layouts::from);
    }
    let named = scenarios.iter().map(|s| Some((s.name.as_str(), shape(s)?)));
    Some(Layouts::of_scenarios(named.collect::<Option<Vec<_>>>()?))
}

/// A study of runs and emulator only.
fn alone(
    study: &Study,
    (parameters, unknowns): (Vec<Parameter>, Vec<Unknown>),
    mut scenarios: Vec<Scenario>,
    layouts: Layouts,
    root: &Node,
) -> Study {
    if let [alone] = &mut scenarios[..] {
        alone.name.clear();
    }
    // The sections were read once without problems.
    let read = PluginSections::read(root, &mut Problems::new());
    let plugins = PluginSections {
        model: read.model,
        design: read.design,
        executor: read.executor,
        simulations: read.simulations,
        surrogate: read.surrogate,
        ..PluginSections::default()
    };
    let gap = Gap::default();
    let own = study.reduced_to(Parts { parameters, unknowns, scenarios, layouts, plugins, gap });
    Study { numerical_error: fidelity::numerical_error(root, &mut Problems::new()), ..own }
}

impl Study {
    /// The study whose runs train the emulator: this study, or that of its parameters without their groups.
    pub fn trained(&self) -> &Self {
        self.hierarchy.trained.as_ref().map_or(self, |trained| &trained.study)
    }
}

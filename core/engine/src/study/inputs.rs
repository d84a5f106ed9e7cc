//! Model inputs that a study sets by expressions, scenario by scenario.

use std::collections::{BTreeMap, BTreeSet};

use lacuna::data::{Field, Unit};
use lacuna::expression::{Data, Fault, Program, Scope};
use lacuna::plugin::Given;
use lacuna::text::{Complaints, Node, Problems};

use super::plain::Study;

/// Model inputs set by expressions in one scenario.
#[derive(Debug, Clone)]
pub struct Computed {
    /// Names of the inputs, in the order of the program's outputs.
    pub names: Vec<String>,
    /// The unit of each.
    pub units: Vec<Unit>,
    /// Index of the study's parameter behind each unknown of the program.
    pub parameters: Vec<usize>,
    /// Compiled expressions.
    pub program: Program,
}

impl Study {
    /// Expressions of `[model] computed` in a scenario, compiled; `None` if there are none. The error lists all faults
    /// of names and units.
    pub fn computed(&self, scenario: usize) -> Result<Option<Computed>, Vec<Fault>> {
        let texts = expressions(self);
        let by_place = self.fields_by_place();
        if texts.is_empty() && by_place.is_empty() {
            return Ok(None);
        }
        let mut scope = Scope::new();
        let mut units = BTreeMap::new();
        let mut parameters = Vec::new();
        let one = |fault: Fault| vec![fault];
        for function in &self.scenarios[scenario].functions {
            scope.function(function.clone()).map_err(one)?;
        }
        for field in &self.fields {
            scope.field(field.clone()).map_err(one)?;
        }
        for (i, unknown) in self.unknowns.iter().enumerate() {
            if unknown.acts_in(scenario) && !texts.contains_key(&unknown.name) {
                scope.unknown(&unknown.name).map_err(one)?;
                units.insert(unknown.name.clone(), self.parameters[i].unit.clone());
                parameters.push(i);
            }
        }
        // A value that is also a parameter is reported with the inputs.
        let known = self.scenarios[scenario].values.iter();
        let mut of_conditions = BTreeMap::new();
        for condition in known.filter(|c| !units.contains_key(&c.name)) {
            scope.data(&condition.name, Data::Number(condition.value)).map_err(one)?;
            of_conditions.extend(condition.unit.clone().map(|unit| (condition.name.clone(), unit)));
        }
        units.extend(of_conditions);
        for (name, text) in texts {
            scope.define(name, text).map_err(one)?;
        }
        let mut names: Vec<String> = texts.keys().cloned().collect();
        for field in by_place {
            for (name, x) in field.inputs().into_iter().zip(&field.at) {
                scope
                    .result(&name, &format!("{}({x} {{{}}})", field.name, place_unit(field)))
                    .map_err(one)?;
                names.push(name);
            }
        }
        let outputs: Vec<&str> = names.iter().map(String::as_str).collect();
        let program = scope.compile(&outputs)?;
        let found = scope.check_units(&units)?;
        let unit = |name: &String| found.get(name).cloned().unwrap_or_default();
        Ok(Some(Computed { units: names.iter().map(unit).collect(), names, parameters, program }))
    }
}

/// Unit of the places of a field, as an expression writes it.
fn place_unit(field: &Field) -> &str {
    if field.at_unit == Unit::dimensionless() { "1" } else { field.at_unit.as_str() }
}

/// `[model] computed`.
fn expressions(study: &Study) -> &BTreeMap<String, String> {
    static NONE: BTreeMap<String, String> = BTreeMap::new();
    study.model.as_ref().map_or(&NONE, |model| &model.common.computed)
}

/// The names that expressions of `[model] computed` use.
pub(super) fn used_in_expressions(study: &Study) -> BTreeSet<String> {
    let functions = study.scenarios.iter().flat_map(|scenario| &scenario.functions);
    let tables: Vec<&str> = functions.map(|function| function.name.as_str()).collect();
    let texts = expressions(study).values();
    texts.flat_map(|text| lacuna::expression::names(text, &tables).unwrap_or_default()).collect()
}

/// Inputs that the study sets, as in [`lacuna::plugin::Context::given`]; a name used only in expressions is not an
/// input of the model.
pub(super) fn all_given(study: &Study) -> Vec<Given> {
    let (hidden, expressions) = (used_in_expressions(study), expressions(study));
    let mut given: Vec<Given> = Vec::new();
    let mut add = |name: &str, unit: Option<&Unit>| {
        let known = given.iter().any(|other| other.name == name);
        if !known && (!hidden.contains(name) || expressions.contains_key(name)) {
            given.push(Given { name: name.to_owned(), unit: unit.cloned() });
        }
    };
    let computed = study.computed(0).ok().flatten();
    let by_coefficients = study.model_takes_fields();
    for (parameter, unknown) in study.parameters.iter().zip(&study.unknowns) {
        if by_coefficients || !unknown.of_field() {
            add(&unknown.name, Some(&parameter.unit));
        }
    }
    for field in study.fields_by_place() {
        field.inputs().iter().for_each(|name| add(name, Some(&field.unit)));
    }
    for name in expressions.keys() {
        let unit = computed
            .as_ref()
            .and_then(|c| c.names.iter().position(|other| other == name).map(|i| &c.units[i]));
        add(name, unit);
    }
    for condition in study.scenarios.iter().flat_map(|scenario| &scenario.values) {
        add(&condition.name, condition.unit.as_ref());
    }
    for (name, quantity) in study.model.iter().flat_map(|model| &model.common.fixed) {
        add(name, quantity.unit.as_ref());
    }
    if let Some(seed) = study.model.as_ref().and_then(|model| model.common.seed.as_ref()) {
        add(seed.as_str(), None);
    }
    given
}

/// Reports errors in the expressions, each once.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let mut said: Vec<Fault> = Vec::new();
    for scenario in 0..study.scenarios.len() {
        let Err(faults) = study.computed(scenario) else { continue };
        for fault in faults {
            if said.contains(&fault) {
                continue;
            }
            let texts = expressions(study);
            let path = match texts.get(&fault.definition) {
                Some(_) => format!("model.computed.{}", fault.definition),
                None => "model.computed".to_owned(),
            };
            said.push(fault.clone());
            let mut complaints = Complaints::new(root, problems);
            let problem = complaints.at(&path).inside(fault.span).say(fault.message);
            problem.expected = fault.expected.map(String::from);
            problem.found = fault.found.map(String::from);
            problem.help.extend(fault.help.map(String::from));
        }
    }
}

//! Addition of terms to the equations of a model.

use std::collections::BTreeMap;

use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::expression::{Fault, Scope};
use lacuna::plugin::amend::{Addition, Change, State as Given};
use lacuna::plugin::model::{Call, EvalError};
use lacuna::plugin::{Amend, Context};
use toml::{Table, Value};

use super::options::{Formula, Observe, State, StateTable};
use super::system::{self, Names, System, key, scope};
use super::{Equations, units};

/// Option name of an expression whose unit is requested.
const ASKED: &str = "asked";

/// Name of the axis of expressions whose values along a run are requested.
const ALONG: &str = "along";

impl Equations {
    /// Returns the states on which the rate of a state depends.
    fn used(&self, scope: &Scope, names: &Names, state: &str) -> Vec<String> {
        let Ok(rate) = system::program(scope, &[format!("rate.{state}")]) else {
            return Vec::new();
        };
        let first = names.variables.len() + names.inputs.len();
        let states = self.state.keys().enumerate();
        states.filter(|(i, _)| rate.depends_on(first + i)).map(|(_, name)| name.clone()).collect()
    }

    /// Returns the differences of states to other quantities in a rate.
    fn references(&self, scope: &Scope, rate: &str) -> Vec<[String; 2]> {
        let is_state = |name: &str| self.state.contains_key(name);
        let of = |name: &String| {
            let found = scope.references(rate, name, &is_state).unwrap_or_default();
            found.into_iter().map(|at| [name.clone(), at]).collect::<Vec<_>>()
        };
        self.state.keys().flat_map(of).collect()
    }

    /// Returns the parts of a rate that change with the time alone, with their units.
    fn inputs(&self, scope: &Scope, context: &Context<'_>, rate: &str) -> Vec<(String, Unit)> {
        let Some((time, ..)) = context.layout.abscissa() else { return Vec::new() };
        let is_state = |name: &str| self.state.contains_key(name);
        let found = scope.inputs(rate, time, &is_state).unwrap_or_default();
        let unit = |part: String| {
            let unit = self.unit(context, &part, &[]).ok()?.unwrap_or_default();
            Some((part, unit))
        };
        found.into_iter().filter_map(unit).collect()
    }

    /// Returns a copy with further states.
    fn with(&self, further: &[Given]) -> Self {
        let mut wider = self.clone();
        for state in further {
            let start = Formula::Text(state.start.clone());
            let table = StateTable { start, unit: Some(state.unit.clone()) };
            wider.state.insert(state.name.clone(), State::Table(table));
            wider.rate.insert(state.name.clone(), state.rate.clone());
        }
        wider
    }
}

impl Amend for Equations {
    fn states(&self, context: &Context<'_>) -> Vec<Given> {
        let names = Names::of(context);
        let Ok(scope) = scope(self, &names) else { return Vec::new() };
        let known = units::known(self, &scope, context);
        let time = context.layout.abscissa().map(|(_, _, unit)| unit);
        let state = |(name, state): (&String, &State)| {
            let unit = known.get(name).cloned().unwrap_or_default();
            let rate = self.rate.get(name).map_or("", String::as_str);
            Given {
                references: self.references(&scope, rate),
                inputs: self.inputs(&scope, context, rate),
                name: name.clone(),
                rate_unit: time.and_then(|time| units::ratio(&unit, time)),
                unit,
                rate: rate.to_owned(),
                uses: self.used(&scope, &names, name),
                start: state.start().0.text(),
            }
        };
        self.state.iter().map(state).collect()
    }

    fn unit(
        &self,
        context: &Context<'_>,
        expression: &str,
        further: &[Given],
    ) -> Result<Option<Unit>, Fault> {
        let wider = self.with(further);
        let names = Names::of(context);
        // The caller knows the position of the expression.
        let bare = |fault: Fault| Fault { definition: String::new(), ..fault };
        let first = |mut faults: Vec<(String, Fault)>| bare(faults.remove(0).1);
        let mut scope = scope(&wider, &names).map_err(first)?;
        scope.result(&key(ASKED), expression).map_err(bare)?;
        // An unknown name is reported before its unit is requested.
        scope.compile(&[&key(ASKED)]).map_err(|mut faults| bare(faults.remove(0)))?;
        let (found, faults) = scope.find_units(&units::known(&wider, &scope, context));
        match faults.into_iter().find(|fault| fault.definition == key(ASKED)) {
            Some(fault) => Err(bare(fault)),
            None => Ok(found.get(&key(ASKED)).cloned().flatten()),
        }
    }

    fn along(&self, call: &Call<'_>, expressions: &[String]) -> Result<Vec<Vec<f64>>, EvalError> {
        let label = |i: usize| format!("{i:04}");
        let labels: Vec<String> = (0..expressions.len()).map(label).collect();
        let observe: BTreeMap<String, String> =
            labels.iter().cloned().zip(expressions.iter().cloned()).collect();
        let shown = Self { observe: Observe::Each(observe), ..self.clone() };
        let is_grid = |axis: &&Axis| matches!(axis.coordinates, Coordinates::Grid { .. });
        let grids = call.layout.axes.iter().filter(is_grid).cloned();
        let axes = std::iter::once(Axis::labels(ALONG, labels)).chain(grids).collect();
        let layout = Layout { axes, ..call.layout.clone() };
        let values = shown.answer(&Call { layout: &layout, ..*call }, false)?.values;
        let length = (values.len() / expressions.len().max(1)).max(1);
        Ok(values.chunks(length).map(<[f64]>::to_vec).collect())
    }

    fn factors(&self, context: &Context<'_>) -> Vec<String> {
        let names = Names::of(context);
        let Ok(system) = System::compile(self, &names) else { return Vec::new() };
        let inputs = names.inputs.iter().enumerate();
        inputs.filter(|(i, _)| system.is_factor(*i)).map(|(_, name)| name.clone()).collect()
    }

    fn amended(&self, additions: &[Addition]) -> Vec<Change> {
        let mut rates = self.rate.clone();
        let mut changes = Vec::new();
        let mut touched: Vec<&String> = Vec::new();
        for (state, summand) in additions.iter().flat_map(|addition| &addition.summands) {
            let Some(rate) = rates.get_mut(state) else { continue };
            *rate = format!("{rate} + {summand}");
            if !touched.contains(&state) {
                touched.push(state);
            }
        }
        let change = |section: &str, name: &str, value: Value| Change {
            path: vec![section.to_owned(), name.to_owned()],
            value,
        };
        changes
            .extend(touched.iter().map(|name| change("rate", name, rates[*name].clone().into())));
        for state in additions.iter().flat_map(|addition| &addition.states) {
            let start: Value = match state.start.parse::<f64>() {
                Ok(number) => number.into(),
                Err(_) => state.start.clone().into(),
            };
            let unit = state.unit.as_str().to_owned().into();
            let table = Table::from_iter([("start".to_owned(), start), ("unit".to_owned(), unit)]);
            changes.push(change("state", &state.name, table.into()));
            changes.push(change("rate", &state.name, state.rate.clone().into()));
        }
        changes
    }
}

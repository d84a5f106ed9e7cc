//! Terms that may be missing in the equations, each as inputs of the model that has the term.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::amend::{Addition, Amend, State};
use lacuna::plugin::effect::Description;
use lacuna::plugin::model::Call;
use lacuna::plugin::registry::{self, Section};
use lacuna::plugin::term::{Index, Place, Sign, Summand, Time};
use lacuna::plugin::{Context, Given, Term};
use lacuna::run::Stop;

use super::pieces::Piece;
use super::unasked;
use crate::gap::candidates::Untried;
use crate::gap::experiment::wider::FreeInput;
use crate::stage::simulator::{Setting, Simulator};
use crate::study::Study;
use crate::study::gap::TermKeys;

/// The share of the rate that a term contributes at the scale of the prior of its coefficient.
const SHARE: f64 = 0.5;

/// The degrees of freedom of the prior of a coefficient, of either sign or positive. Its tails are heavy: what is missing may
/// be many times as large as the rate in the middle of the priors, from which its scale is taken.
const FREEDOM: f64 = 3.0;

/// The number of points of the priors at which sizes are sought that the middle of the priors does not have.
const POINTS: u64 = 16;

/// Adds the terms of a study to its pieces and inputs: those that it names, and those of the library that are tried
/// without being named. Returns the types of the library that fit some equation and could be made for none.
pub(super) fn add(
    study: &Study,
    all: &mut Vec<Piece>,
    inputs: &mut Vec<FreeInput>,
) -> Result<Vec<Untried>, Stop> {
    let terms = &study.gap.inside.terms;
    let library = unasked::library(study);
    if terms.is_empty() && library.is_empty() {
        return Ok(Vec::new());
    }
    let simulator = Simulator::of(study)?.ok_or_else(|| Stop::new("the study has no model"))?;
    let amend = simulator.model.amend().ok_or_else(|| {
        Stop::new("the model has no equations to which terms could be added")
            .help("take `[[gap.term]]` out, or write the model as equations")
    })?;
    let terms_of = TermSetting { study, simulator: &simulator, amend };
    for section in terms {
        let name = section.common.name(&section.built);
        let found = terms_of.summand(section, name);
        let found = found.map_err(|e| Stop::new(format!("the term `{name}`: {e}")))?;
        put(section, name, found, all, inputs);
    }
    let mut untried = Vec::new();
    for section in unasked::sections(study, &library, &terms_of.states()) {
        let name = section.common.name(&section.built);
        match terms_of.summand(&section, name) {
            Ok(found) => put(&section, name, found, all, inputs),
            Err(reason) => untried.push(Untried { kind: kind(&section, name), reason }),
        }
    }
    untried.retain(|one: &Untried| all.iter().all(|piece| piece.kind != one.kind));
    untried.dedup_by(|later, first| later.kind == first.kind);
    Ok(untried)
}

/// Adds a term and its coefficient to the pieces.
fn put(
    section: &Section<dyn Term, TermKeys>,
    name: &str,
    (summand, first): (Summand, FreeInput),
    all: &mut Vec<Piece>,
    inputs: &mut Vec<FreeInput>,
) {
    let begin = inputs.len();
    inputs.push(first);
    inputs.extend(summand.indices.iter().map(index));
    all.push(Piece {
        kind: kind(section, name),
        description: description(&*section.built.plugin, &summand),
        places: (begin..inputs.len()).collect(),
        addition: Some(addition(name, &section.common.state, summand)),
        at: None,
        tried: 1,
    });
}

/// The types that a term of the library contains as special cases; empty for other candidates.
pub(super) fn contained(kind: &str) -> Vec<&'static str> {
    let built = registry::from_text::<dyn Term>(kind, "");
    built.map_or_else(|_| Vec::new(), |built| built.plugin.contains().to_vec())
}

/// The name of the library's term; for an expression of the study, the name of its coefficient.
fn kind(section: &Section<dyn Term, TermKeys>, name: &str) -> String {
    if section.built.plugin.listed() { section.built.name } else { name }.to_owned()
}

fn index(index: &Index) -> FreeInput {
    // With the coefficient at zero, the value of an index has no effect.
    let absent = index.starts.first().copied().unwrap_or_else(|| index.prior.quantile(0.5));
    FreeInput::new(&index.name, index.unit.clone(), absent, index.prior.clone())
        .starting_from(index.starts.clone())
}

fn description(term: &dyn Term, summand: &Summand) -> Description {
    let mut description = term.describe();
    if let Some(fixed) = &summand.fixed {
        description.formula = format!("{}, {fixed}", description.formula);
    }
    description
}

/// The coefficient times the shape of the term, for each state.
fn addition(name: &str, state: &str, summand: Summand) -> Addition {
    let product = |shape: &str| format!("{name} * ({shape})");
    let first = (state.to_owned(), product(&summand.shape));
    let beside = summand.beside.iter().map(|(state, shape)| (state.clone(), product(shape)));
    Addition { summands: std::iter::once(first).chain(beside).collect(), states: summand.states }
}

/// Model and study for which terms are made.
struct TermSetting<'a> {
    study: &'a Study,
    simulator: &'a Simulator<'a>,
    amend: &'a dyn Amend,
}

impl TermSetting<'_> {
    /// The states to whose rates terms can be added.
    fn states(&self) -> Vec<State> {
        let setting = &self.simulator.settings[0];
        let layout = self.study.layouts.of_scenario(&setting.scenario.name);
        layout
            .map_or_else(Vec::new, |(layout, _)| self.amend.states(&self.study.context_of(&layout)))
    }

    /// The summand of a term, and its coefficient.
    fn summand(
        &self,
        section: &Section<dyn Term, TermKeys>,
        name: &str,
    ) -> Result<(Summand, FreeInput), String> {
        let setting = &self.simulator.settings[0];
        let (layout, _) = self
            .study
            .layouts
            .of_scenario(&setting.scenario.name)
            .ok_or("the study has no response")?;
        let context = self.study.context_of(&layout);
        let states = self.amend.states(&context);
        let state = states
            .iter()
            .find(|state| state.name == section.common.state)
            .ok_or_else(|| format!("the model has no state `{}`", section.common.state))?;
        let size = |expression: &str| self.size(expression);
        let time = Time::of(&setting.asked);
        let place = Place { state, name, time, size: &size };
        let summand = section.built.plugin.summand(&place)?;
        let unit = self.unit(&context, state, &summand)?;
        let prior = match &section.common.prior {
            Some(prior) => prior.clone(),
            None => self.prior(state, &summand)?,
        };
        Ok((summand, FreeInput::new(name, unit, 0.0, prior)))
    }

    /// The unit of the coefficient.
    fn unit(
        &self,
        context: &Context<'_>,
        state: &State,
        summand: &Summand,
    ) -> Result<Unit, String> {
        coefficient_unit(self.amend, context, state, summand)
    }

    /// The prior of the coefficient: its width follows from the ratio of the size of the rate to that of the shape.
    fn prior(&self, state: &State, summand: &Summand) -> Result<Distribution, String> {
        // What the term brings has no size before the term is there.
        let brought = |name: &str| {
            summand.indices.iter().any(|i| i.name == name)
                || summand.states.iter().any(|s| s.name == name)
        };
        let tables = self.study.scenarios.iter().flat_map(|scenario| &scenario.functions);
        let tables: Vec<&str> = tables.map(|function| function.name.as_str()).collect();
        let names =
            lacuna::expression::names(&summand.shape, &tables).map_err(|e| e.to_string())?;
        let shape = if names.iter().any(|name| brought(name)) {
            summand.scale.clone()
        } else {
            Some(summand.shape.clone())
        };
        let shape = shape.map_or(Ok(1.0), |shape| self.size(&shape))?;
        let rate = self.size(&state.rate)?;
        let sd = SHARE * rate / shape;
        if !(sd.is_finite() && sd > 0.0) {
            return Err(format!(
                "the rate of `{}` is {rate} and the term {shape} along the run at the middle of the priors, so that its \
                 coefficient has no natural size: give it a `prior`",
                state.name
            ));
        }
        Ok(match summand.sign {
            Sign::Either => Distribution::StudentT([FREEDOM, 0.0, sd]),
            Sign::Positive => Distribution::HalfStudentT([FREEDOM, sd]),
        })
    }

    /// The root mean square of an expression over all scenarios: at the medians of the priors, or where it has no size there, as
    /// for a body that starts at rest, the median over other points of the priors.
    fn size(&self, expression: &str) -> Result<f64, String> {
        let has_size = |size: &f64| size.is_finite() && *size > 0.0;
        let middle = self.size_at(expression, |_| 0.5)?;
        if has_size(&middle) {
            return Ok(middle);
        }
        let stream = Stream::root(self.study.about.seed).named("sizes of terms");
        let level = |i: u64, j: usize| uniform(&mut stream.at(i).at(j as u64).generator());
        let sizes = (0..POINTS).map(|i| self.size_at(expression, |j| level(i, j)));
        let mut sizes: Vec<f64> = sizes.filter_map(Result::ok).filter(has_size).collect();
        sizes.sort_by(f64::total_cmp);
        Ok(sizes.get(sizes.len() / 2).copied().unwrap_or(middle))
    }

    /// The root mean square of an expression over all scenarios at a point of the priors: `level` of each parameter is its
    /// quantile.
    fn size_at(&self, expression: &str, level: impl Fn(usize) -> f64) -> Result<f64, String> {
        let parameters = self.study.parameters.iter().enumerate();
        let point: Vec<f64> = parameters.map(|(j, p)| p.prior.quantile(level(j))).collect();
        let (mut sum, mut count) = (0.0, 0.0);
        for setting in &self.simulator.settings {
            let mut inputs = setting.inputs(&point);
            let (mut names, mut units) =
                (self.simulator.names.clone(), self.simulator.units.clone());
            for (name, unit, value) in self.idle(setting) {
                names.push(name.clone());
                units.push(unit);
                inputs.push(value);
            }
            let call = self.simulator.call(setting, &inputs);
            let call = Call { names: &names, units: &units, ..call };
            let sizes = self.amend.sizes(&call, &[expression.to_owned()]);
            let sizes = sizes.map_err(|error| format!("`{expression}`: {error}"))?;
            sum += sizes.iter().map(|s| s * s).sum::<f64>();
            count += sizes.len() as f64;
        }
        Ok((sum / f64::max(count, 1.0)).sqrt())
    }

    /// The values of a scenario that the study's equations do not use but a term may use.
    fn idle(&self, setting: &Setting<'_>) -> Vec<(String, Unit, f64)> {
        let given = self.study.given.iter();
        let idle = given.filter(|given| !self.simulator.names.contains(&given.name));
        idle.filter_map(|given| {
            let value = setting.scenario.value(&given.name)?;
            let unit = value.unit.clone().unwrap_or_default();
            Some((given.name.clone(), unit, value.value))
        })
        .collect()
    }
}

/// The unit of the coefficient of a summand: that of the rate by that of the shape.
pub(in crate::gap) fn coefficient_unit(
    amend: &dyn Amend,
    context: &Context<'_>,
    state: &State,
    summand: &Summand,
) -> Result<Unit, String> {
    let indices = summand.indices.iter();
    let indices = indices.map(|i| Given { name: i.name.clone(), unit: Some(i.unit.clone()) });
    let given: Vec<Given> = context.given.iter().cloned().chain(indices).collect();
    let context = Context { given: &given, ..*context };
    let shape = amend.unit(&context, &summand.shape, &summand.states);
    let shape = shape.map_err(|fault| format!("`{}`: {fault}", summand.shape))?;
    let rate = state.rate_unit.as_ref();
    let unit = rate.and_then(|rate| rate.times(&shape.unwrap_or_default().power(-1.0)?));
    unit.map(Unit::plain).ok_or_else(|| {
        format!("no unit is that of the rate of `{}` by that of `{}`", state.name, summand.shape)
    })
}

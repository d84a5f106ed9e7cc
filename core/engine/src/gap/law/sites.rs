//! The rates that may lack a law, and the quantities of which it may be a function.

use lacuna::data::Unit;
use lacuna::plugin::Context;
use lacuna::plugin::amend::{Amend, State};

use crate::gap::inside::{Sited, sites};

/// The largest number of arguments of one rate.
const MOST: usize = 8;

/// A rate that is not simply another state.
pub(super) struct Site {
    /// The state.
    pub state: State,
    /// The unit of its rate.
    pub unit: Unit,
    /// The quantities of which a law may be a function, the state itself first.
    pub arguments: Vec<Argument>,
}

/// A quantity of which a law may be a function, as an expression with its unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Argument {
    pub text: String,
    pub unit: Unit,
    /// True if it depends on no state.
    pub of_time: bool,
}

/// All rates of a model that are not simply another state.
pub(super) fn all(amend: &dyn Amend, context: &Context<'_>) -> Vec<Site> {
    let states = amend.states(context);
    let found = sites(&states);
    let site = |sited: &Sited<'_>| {
        let unit = sited.state.rate_unit.clone()?.plain();
        let arguments = arguments(amend, context, sited);
        Some(Site { state: sited.state.clone(), unit, arguments })
    };
    found.iter().filter_map(site).collect()
}

fn arguments(amend: &dyn Amend, context: &Context<'_>, sited: &Sited<'_>) -> Vec<Argument> {
    let Sited { state, positions, others } = sited;
    let mut texts: Vec<(String, bool)> = vec![(state.name.clone(), false)];
    let alone = positions.iter().chain(others).map(|other| (other.name.clone(), false));
    texts.extend(alone);
    let own = std::iter::once(state).chain(others).copied().collect::<Vec<&State>>();
    texts.extend(differences(&own).chain(differences(positions)).map(|text| (text, false)));
    let own = state.references.iter().filter(|[name, _]| *name == state.name);
    texts.extend(own.map(|[name, at]| (format!("{name} - ({at})"), false)));
    texts.extend(state.inputs.iter().map(|(text, _)| (text.clone(), true)));
    let mut all: Vec<Argument> = Vec::new();
    for (text, of_time) in texts {
        if all.iter().any(|other| other.text == text) || all.len() == MOST {
            continue;
        }
        if let Ok(Some(unit)) = amend.unit(context, &text, &[]) {
            all.push(Argument { text, unit, of_time });
        }
    }
    all
}

/// The differences of states of one dimension.
fn differences(states: &[&State]) -> impl Iterator<Item = String> {
    let pairs = states.iter().enumerate().flat_map(|(i, a)| {
        states[i + 1..].iter().filter(|b| a.unit.same_dimension(&b.unit)).map(move |b| (a, b))
    });
    pairs.map(|(a, b)| format!("{} - {}", a.name, b.name)).collect::<Vec<_>>().into_iter()
}

//! Terms of the library that are tried without being named, in every equation of a study that they fit.

use lacuna::plugin::amend::State;
use lacuna::plugin::registry::Section;
use lacuna::plugin::term::Site;
use lacuna::plugin::{Effect, Term, registry};
use lacuna::text::values::Name;
use toml::Table;

use crate::study::Study;
use crate::study::gap::TermKeys;

/// The terms of the library that are tried without being named. If the study's model is its own forward map and has
/// equations, these are all terms, or those that `candidates` names if it names any; none if `terms` disables them.
pub(super) fn library(study: &Study) -> Vec<&'static str> {
    let amends = study.model.as_ref().is_some_and(|model| model.built.plugin.amend().is_some());
    if !amends || study.surrogate.is_some() || !study.gap.keys.terms {
        return Vec::new();
    }
    let chosen = study.gap.keys.candidates.as_deref();
    let is_effect =
        |name: &str| registry::entries::<dyn Effect>().iter().any(|entry| entry.name == name);
    let wanted = |name: &str| match chosen {
        // If an effect has the same name, the name refers to the effect.
        Some(chosen) => chosen.iter().any(|other| other == name) && !is_effect(name),
        None => true,
    };
    let entries = registry::entries::<dyn Term>();
    entries.iter().map(|entry| entry.name).filter(|name| wanted(name)).collect()
}

/// A section for each place of each term: every state whose rate is not simply another state, and the quantities of
/// which the term can be a function there.
pub(super) fn sections(
    study: &Study,
    library: &[&'static str],
    states: &[State],
) -> Vec<Section<dyn Term, TermKeys>> {
    let mut taken: Vec<String> = study.given.iter().map(|given| given.name.clone()).collect();
    taken.extend(states.iter().map(|state| state.name.clone()));
    let asked = &study.gap.inside.terms;
    taken.extend(asked.iter().map(|term| term.common.name(&term.built).to_owned()));
    let sites: Vec<Sited<'_>> = sites(states);
    let mut all = Vec::new();
    for name in library {
        let Some(places) = places(name, &sites) else { continue };
        for (state, options) in &places {
            let is_asked = asked.iter().any(|term| {
                term.built.name == *name
                    && term.common.state == **state
                    && term.built.options == *options
            });
            if is_asked {
                continue;
            }
            let own = free(called(name, state, options, places.len()), &taken);
            taken.push(own.clone());
            let built = registry::from_text::<dyn Term>(name, &options.to_string());
            let (Ok(built), Ok(own)) = (built, Name::new(own)) else { continue };
            let common = TermKeys { state: (*state).clone(), name: Some(own), prior: None };
            all.push(Section { common, built });
        }
    }
    all
}

/// A state with the quantities on which its rate depends.
pub(in crate::gap) struct Sited<'a> {
    pub state: &'a State,
    pub positions: Vec<&'a State>,
    pub others: Vec<&'a State>,
}

/// All states whose rate is not simply another state.
pub(in crate::gap) fn sites(states: &[State]) -> Vec<Sited<'_>> {
    let leader = |state: &State| {
        let rate = state.rate.trim();
        states.iter().find(|other| other.name == rate).map(|other| other.name.as_str())
    };
    let moves = |name: &str| states.iter().any(|s| s.name == name && leader(s).is_some());
    let site = |state: &State| {
        let is_position = |other: &&State| {
            leader(other) == Some(&state.name)
                || state.uses.contains(&other.name) && leader(other).is_some()
        };
        let positions: Vec<&State> = states.iter().filter(is_position).collect();
        let is_other = |other: &&State| {
            state.uses.contains(&other.name) && other.name != state.name && !moves(&other.name)
        };
        (positions, states.iter().filter(is_other).collect::<Vec<_>>())
    };
    let own = states.iter().filter(|state| leader(state).is_none());
    own.map(|state| {
        let (positions, others) = site(state);
        Sited { state, positions, others }
    })
    .collect()
}

/// The places of a term: states with the options of the term there.
fn places<'a>(name: &str, sites: &[Sited<'a>]) -> Option<Vec<(&'a String, Table)>> {
    // A term with mandatory options proposes nothing.
    let built = registry::from_text::<dyn Term>(name, "").ok()?;
    let places = sites.iter().flat_map(|sited| {
        let Sited { state, positions, others } = sited;
        let proposals = built.plugin.proposals(&Site { state, positions, others });
        proposals.into_iter().map(|options| (&state.name, options))
    });
    Some(places.collect())
}

/// The name of a coefficient: that of the term, followed by its place if the term has several.
fn called(name: &str, state: &str, options: &Table, places: usize) -> String {
    let of = options.get("of").and_then(toml::Value::as_str).filter(|of| *of != state);
    match of {
        _ if places < 2 => name.to_owned(),
        Some(of) => format!("{name}_{state}_{}", argument(of)),
        None => format!("{name}_{state}"),
    }
}

/// The part of a name that stands for an argument: a state, the negative of one, or a function of the time.
fn argument(of: &str) -> String {
    match of.strip_prefix('-') {
        _ if lacuna::expression::is_name(of) => of.to_owned(),
        Some(state) if lacuna::expression::is_name(state) => format!("minus_{state}"),
        _ => "input".to_owned(),
    }
}

/// The name, with a number if it is taken.
pub(in crate::gap) fn free(name: String, taken: &[String]) -> String {
    let mut free = name.clone();
    let mut count = 1;
    while taken.contains(&free) {
        count += 1;
        free = format!("{name}_{count}");
    }
    free
}

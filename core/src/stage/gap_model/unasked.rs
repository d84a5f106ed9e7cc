//! Terms that nobody has to name: the library's, wherever the equations of a study have a place for them.

use toml::Table;

use crate::plugin::amend::State;
use crate::plugin::registry::{self, Section};
use crate::plugin::term::Site;
use crate::plugin::{Effect, Term};
use crate::study::Study;
use crate::study::gap::TermKeys;
use crate::study::values::Name;

/// The terms of the library that are tried unasked: all in a study whose model is its own forward map and has equations,
/// those that `candidates` names where it names any; none where `terms` says so.
pub(super) fn library(study: &Study) -> Vec<&'static str> {
    let amends = study.model.as_ref().is_some_and(|model| model.built.plugin.amend().is_some());
    if !amends || study.surrogate.is_some() || !study.gap.keys.terms {
        return Vec::new();
    }
    let chosen = study.gap.keys.candidates.as_deref();
    let is_effect =
        |name: &str| registry::entries::<dyn Effect>().iter().any(|entry| entry.name == name);
    let wanted = |name: &str| match chosen {
        // A name that is also an effect's is that of the effect.
        Some(chosen) => chosen.iter().any(|other| other == name) && !is_effect(name),
        None => true,
    };
    let entries = registry::entries::<dyn Term>();
    entries.iter().map(|entry| entry.name).filter(|name| wanted(name)).collect()
}

/// A section for each place of each term: every state whose rate is more than another state, and what the term can be a
/// function of there.
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

/// A state with what its rate depends on.
struct Sited<'a> {
    state: &'a State,
    positions: Vec<String>,
    others: Vec<String>,
}

fn sites(states: &[State]) -> Vec<Sited<'_>> {
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
        let positions = states.iter().filter(is_position).map(|other| other.name.clone());
        let others = state.uses.iter().filter(|name| **name != state.name && !moves(name));
        (positions.collect(), others.cloned().collect())
    };
    let own = states.iter().filter(|state| leader(state).is_none());
    own.map(|state| {
        let (positions, others) = site(state);
        Sited { state, positions, others }
    })
    .collect()
}

/// The places of a term: states with its options there.
fn places<'a>(name: &str, sites: &[Sited<'a>]) -> Option<Vec<(&'a String, Table)>> {
    // A term that cannot do without options proposes nothing.
    let built = registry::from_text::<dyn Term>(name, "").ok()?;
    let places = sites.iter().flat_map(|sited| {
        let Sited { state, positions, others } = sited;
        let proposals = built.plugin.proposals(&Site { state, positions, others });
        proposals.into_iter().map(|options| (&state.name, options))
    });
    Some(places.collect())
}

/// The name of a coefficient: that of the term, with its place where the term has several.
fn called(name: &str, state: &str, options: &Table, places: usize) -> String {
    let of = options.get("of").and_then(toml::Value::as_str).filter(|of| *of != state);
    match of {
        _ if places < 2 => name.to_owned(),
        Some(of) => format!("{name}_{state}_{of}"),
        None => format!("{name}_{state}"),
    }
}

fn free(name: String, taken: &[String]) -> String {
    let mut free = name.clone();
    let mut count = 1;
    while taken.contains(&free) {
        count += 1;
        free = format!("{name}_{count}");
    }
    free
}

//! Consistency of `[[gap.next]]` and `[gap.quantity]` with the rest of the study.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Coordinates, Layout};
use lacuna::plugin::effect::{On, acts};
use lacuna::text::values::Interval;
use lacuna::text::{Complaints, Node, Problems};

use super::effects::places;
use super::gap::{known_intervals, known_scenarios};
use crate::study::Study;
use crate::study::gap::next::NextKeys;

/// Reports places that the response does not have, and runs that nothing would use; `gap` is the section.
pub(super) fn check(study: &Study, gap: &Node, problems: &mut Problems) {
    let nodes = gap.get("next").map(Node::elements).unwrap_or_default();
    for (keys, node) in study.gap.keys.next.iter().zip(nodes) {
        problems.within("next", |problems| {
            Chosen { scenarios: &keys.scenarios, on: &keys.on, along: &keys.along }
                .check(study, node, problems);
            if keys.is_computed() {
                computed(study, keys, &mut Complaints::new(node, problems));
            }
        });
    }
    if let (Some(keys), Some(node)) = (&study.gap.keys.quantity, gap.get("quantity")) {
        problems.within("quantity", |problems| {
            Chosen { scenarios: &keys.scenarios, on: &keys.on, along: &keys.along }
                .check(study, node, problems);
        });
    }
}

/// Values of the response that a section chooses.
struct Chosen<'a> {
    scenarios: &'a [String],
    on: &'a On,
    along: &'a [Interval],
}

impl Chosen<'_> {
    /// Reports names and intervals that the response does not have, or a choice that is empty although it has each of them.
    fn check(&self, study: &Study, node: &Node, problems: &mut Problems) {
        let before = problems.len();
        let mut complaints = Complaints::new(node, problems);
        known_scenarios(study, "scenarios", self.scenarios, &mut complaints);
        places(study, "on", self.on, &mut complaints);
        known_intervals(study, "along", self.along, &mut complaints);
        if problems.len() == before && !study.layouts.blocks.iter().any(|layout| self.is_in(layout))
        {
            Complaints::new(node, problems)
                .at("")
                .say("no value of the response has all of these: scenarios, labels and places on the last axis")
                .help("the scenarios may have other sensors or other times: choose what they have");
        }
    }

    /// Returns true if some value of a layout is chosen.
    fn is_in(&self, layout: &Layout) -> bool {
        let mut on = self.on.clone();
        if !self.scenarios.is_empty() {
            on.insert(SCENARIO.to_owned(), self.scenarios.to_vec());
        }
        let acts = if on.is_empty() { vec![true; layout.len()] } else { acts(layout, &on) };
        let grid = match layout.axes.last().map(|axis| &axis.coordinates) {
            Some(Coordinates::Grid { values, .. }) => values.as_slice(),
            _ => &[],
        };
        let inside = |i: usize| {
            let x = grid.get(i % grid.len().max(1));
            x.is_some_and(|x| self.along.iter().any(|interval| interval.contains(*x)))
        };
        acts.iter().enumerate().any(|(i, acts)| *acts && (self.along.is_empty() || inside(i)))
    }
}

/// Reports an option of further computations that also measures, has no cost, or makes an error smaller that the study does
/// not have.
fn computed(study: &Study, keys: &NextKeys, complaints: &mut Complaints<'_>) {
    let measured = [
        ("scenarios", !keys.scenarios.is_empty()),
        ("on", !keys.on.is_empty()),
        ("along", !keys.along.is_empty()),
        ("noise", keys.noise.is_some()),
        ("replicates", keys.replicates.get() > 1),
    ];
    for (key, _) in measured.into_iter().filter(|(_, is_set)| *is_set) {
        complaints
            .at(key)
            .say("an option is either measured or computed")
            .help("write two `[[gap.next]]`, one with the measurements and one with the runs");
    }
    if keys.cost.is_none() {
        complaints
            .at("")
            .say("the cost of a computation in units of a measurement is not known")
            .help(
                "state `cost`: a measurement of one scenario costs 1 unless it states another cost",
            );
    }
    let of_surrogate =
        [("runs", keys.runs.is_some()), ("emulator_error", keys.emulator_error.is_some())];
    for (key, _) in of_surrogate.into_iter().filter(|(_, is_set)| *is_set) {
        if study.surrogate.is_none() {
            complaints
                .at(key)
                .say("the study has no `[surrogate]` whose error could become smaller")
                .help("take the option out");
        }
    }
    if keys.numerical_error.is_some() && study.numerical_error.is_none() {
        complaints
            .at("numerical_error")
            .say("the study has no `[numerical_error]` that could become smaller")
            .help("take the option out");
    }
}

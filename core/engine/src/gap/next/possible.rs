//! The hypotheses of what is missing: the types that a search weighed in the place of its least certain effect, and a free
//! form in its place.

use lacuna::plugin::discrepancy::CommonError;

use super::planned::planned;
use crate::gap::candidates::{Candidate, Placement};
use crate::gap::experiment::Experiment;
use crate::gap::search::{Explanation, SearchResult, Weighed};
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit};
use crate::gap::system::remainder::{Remainder, noise_of_mean};

/// The smallest share of the posterior probability with which a type is a hypothesis of what is missing.
const POSSIBLE: f64 = 1e-3;

/// The smallest probability that no type is right with which that is a hypothesis.
const DOUBT: f64 = 0.05;

/// The lengths of a free form, as shares of a curve: like the types it changes a response slowly. The data decide; a short
/// one alone expects ripples that none of the types makes, and more replicates would seem to tell much.
const LENGTHS: [f64; 3] = [0.1, 0.3, 1.0];

/// The name of the model without effects.
const NOTHING: &str = "nothing";

/// The name of the hypothesis that no type is right.
const NONE: &str = "none of these";

/// A hypothesis with its fit to the data.
pub(super) struct Possible<'a> {
    /// The type of the effect that is in question.
    pub kind: String,
    /// The posterior probability of the type.
    pub weight: f64,
    system: System<'a>,
    fit: Fit,
    remainder: Option<CommonError>,
}

impl<'a> Possible<'a> {
    fn of(found: &SearchResult<'a>, kind: &str, weight: f64, system: System<'a>, fit: Fit) -> Self {
        Self::leaving(found, &found.remainder, kind, weight, system, fit)
    }

    fn leaving(
        found: &SearchResult<'a>,
        remainder: &Remainder,
        kind: &str,
        weight: f64,
        system: System<'a>,
        fit: Fit,
    ) -> Self {
        let outputs = system.experiment.outputs() as f64;
        let white = remainder.white(&found.whitener);
        let setting = white.evidences(&fit).and_then(|all| all.best());
        let remainder = setting.map(|setting| remainder.common(setting, outputs));
        Self { kind: kind.to_owned(), weight, system, fit, remainder }
    }

    /// The explanation with the remainder that it leaves.
    pub fn explanation(&self) -> Explanation<'a, '_> {
        Explanation { system: &self.system, fit: &self.fit, remainder: self.remainder.as_ref() }
    }
}

/// The hypotheses after a search. The type of one effect is in question, the least certain one; the others are there in
/// every hypothesis. `none` is the probability that none of the types is right. What the search found is the only
/// hypothesis if nothing else is possible.
pub(super) fn possible<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    none: Option<f64>,
) -> Vec<Possible<'a>> {
    let doubt = |types: &[(String, f64)]| types.iter().map(|(_, p)| p * (1.0 - p)).sum::<f64>();
    let slot = (0..found.slots.len())
        .max_by(|a, b| doubt(&found.types[*a]).total_cmp(&doubt(&found.types[*b])).then(b.cmp(a)));
    let mut all = slot.map_or_else(Vec::new, |slot| of_slot(found, candidates, slot));
    if all.len() < 2 {
        let kinds: Vec<&str> =
            found.chosen.iter().map(|own| candidates[own.candidate].kind.as_str()).collect();
        let kind = if kinds.is_empty() { NOTHING.to_owned() } else { kinds.join(" and ") };
        let (system, fit) = (found.system.clone(), found.last.fit.clone());
        all = vec![Possible::of(found, &kind, 1.0, system, fit)];
    }
    if let (Some(slot), Some(none)) = (slot, none.filter(|none| *none >= DOUBT)) {
        let types: f64 = all.iter().map(|own| own.weight).sum();
        for own in &mut all {
            own.weight *= (1.0 - none) / types;
        }
        let free = free_form(found, slot, none, &all);
        all.push(free);
    }
    all
}

/// A free form in the place of one effect, on the whole response. Where nothing was measured it is at least as large as where
/// something was, and grows from there as the `types` in its place do.
fn free_form<'a>(
    found: &SearchResult<'a>,
    slot: usize,
    weight: f64,
    types: &[Possible<'a>],
) -> Possible<'a> {
    let experiment = found.system.experiment;
    let mut effects = found.system.effects.clone();
    let begin = experiment.parameters.len()
        + effects[..slot].iter().map(|effect| effect.absent().len()).sum::<usize>();
    let end = begin + effects.remove(slot).absent().len();
    let system = System::new(experiment, effects);
    let mut start = found.last.fit.at.point.clone();
    start.drain(begin..end);
    let own = fit(&system, &found.whitener, &found.means, &start);
    let everything: Vec<Vec<usize>> =
        experiment.curves.iter().map(|curve| curve.outputs.clone().collect()).collect();
    let (whole, _) = planned(experiment, &found.noise, &everything, None);
    let response = &own.at.response;
    // As large as the gap, so that the data at hand speak neither for the types nor for the free form.
    let gap = root_mean_square(&own.residual, experiment).max(1.0);
    let scale = noise_of_mean(experiment, &found.noise, response);
    let scale = scale.into_iter().map(|noise| gap * noise).collect();
    let (scale, growth) = extended(experiment, scale, &sizes(types, response));
    let slopes = system.around(&own.at).slopes;
    let remainder = Remainder::of_scale(&whole, &scale, &slopes, &LENGTHS);
    Possible::leaving(found, &remainder.grown(&growth), NONE, weight, system, own)
}

/// The root mean square of whitened values over the measured ones.
fn root_mean_square(white: &[f64], experiment: &Experiment<'_>) -> f64 {
    let measured: usize = experiment.curves.iter().map(|curve| curve.measured.len()).sum();
    (white.iter().map(|z| z * z).sum::<f64>() / measured.max(1) as f64).sqrt()
}

/// The mean square of what the types change of each output, beside the response without them, in its squared unit.
fn sizes(types: &[Possible<'_>], without: &[f64]) -> Vec<f64> {
    let all: f64 = types.iter().map(|own| own.weight).sum();
    let square = |own: &Possible<'_>, i: usize| {
        own.weight / all * (own.fit.at.response[i] - without[i]).powi(2)
    };
    (0..without.len()).map(|i| types.iter().map(|own| square(own, i)).sum()).collect()
}

/// The scale of a free form along each curve, that of the others where a curve has no data, and the factor by which it is
/// larger at each output that was not measured: about as the changes by the types, whose mean `squares` these are.
fn extended(
    experiment: &Experiment<'_>,
    mut scale: Vec<f64>,
    squares: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let (mut count, mut of_scale, mut of_types) = (0.0, 0.0, f64::MIN_POSITIVE);
    for (curve, scale) in experiment.curves.iter().zip(&scale) {
        count += curve.measured.len() as f64;
        of_scale += curve.measured.len() as f64 * scale * scale;
        of_types += curve.measured.iter().map(|&i| squares[i]).sum::<f64>();
    }
    let mut growth = vec![1.0; squares.len()];
    for (curve, scale) in experiment.curves.iter().zip(&mut scale) {
        if curve.measured.is_empty() {
            *scale = (of_scale / count).sqrt();
        }
        for i in curve.outputs.clone().filter(|i| !curve.measured.contains(i)) {
            growth[i] = ((of_scale / of_types * squares[i]).sqrt() / *scale).max(1.0);
        }
    }
    (scale, growth)
}

/// The best placement of each possible type in the place of one effect.
fn of_slot<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    slot: usize,
) -> Vec<Possible<'a>> {
    let mut all: Vec<Possible<'a>> = Vec::new();
    for weighed in &found.slots[slot] {
        let kind = &candidates[weighed.placement.candidate].kind;
        let share = found.types[slot].iter().find(|(own, _)| own == kind).map_or(0.0, |(_, p)| *p);
        let is_known = all.iter().any(|own| own.kind == *kind);
        if share >= POSSIBLE && !is_known {
            let system = exchanged(found, candidates, slot, weighed);
            all.push(Possible::of(found, kind, share, system, weighed.fit.clone()));
        }
    }
    all
}

/// The system in which a placement, the last of its effects, is in the place of one effect.
fn exchanged<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    slot: usize,
    weighed: &Weighed,
) -> System<'a> {
    let experiment = found.system.experiment;
    let others = found.chosen.iter().enumerate().filter(|(i, _)| *i != slot);
    let all = others.map(|(_, own)| own).chain([&weighed.placement]);
    let placed =
        |own: &Placement| own.placed(experiment, candidates, &candidates[own.candidate].kind);
    System::new(experiment, all.map(placed).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lacuna::data::{Measurements, Replicate};

    use super::extended;
    use crate::gap::experiment::Experiment;
    use crate::gap::testing::SyntheticExperiment;

    /// Two conditions, the second without data. The types change three times as much there as where something was
    /// measured, and a tenth at its last place.
    #[test]
    fn a_free_form_grows_as_the_types_where_nothing_was_measured() {
        let world =
            SyntheticExperiment::new(&["slow", "fast"], &["s"], 3, 0.0, &["a"], |_, _, _, _| 0.0);
        let values = (0..6).map(|i| (i < 2).then_some(1.0)).collect();
        let replicate = Replicate::new("1", values);
        let measured = Measurements::new(world.layouts.blocks[0].clone(), vec![replicate]).into();
        let experiment =
            Experiment::new(&world.layouts, &world.parameters, &world.forward, &measured);
        let squares = [16.0, 16.0, 64.0, 144.0, 144.0, 0.16];
        let (scale, growth) = extended(&experiment, vec![0.2, 0.0], &squares);
        assert!((scale[0] - 0.2).abs() < 1e-12 && (scale[1] - 0.2).abs() < 1e-12, "{scale:?}");
        for (found, expected) in growth.iter().zip([1.0, 1.0, 2.0, 3.0, 3.0, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{growth:?}");
        }
    }
}

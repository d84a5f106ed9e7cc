//! Averages over the models that a search compared: posterior probabilities that an effect is included.
//!
//! A model is a set of placements. Every type is in a model or not, with equal prior mass for each further effect, and
//! its placement has the prior mass of [`log_prior`](super::log_prior): a spike and slab whose posterior is summed over
//! the models that the search visited, in place of sampling them (Nayek et al., Mechanical Systems and Signal Processing
//! 161 (2021) 107930). Models far less probable than the best one are left out (Occam's window: Madigan and Raftery,
//! Journal of the American Statistical Association 89 (1994) 1535).

use lacuna::math::moments::log_sum;
use lacuna::plugin::effect::On;
use serde::{Deserialize, Serialize};

use super::refit::Weighed;
use crate::gap::candidates::{Candidate, Placement};

/// The log odds at which a model is outside of the window: together the models outside change no probability that is
/// printed with two digits.
const WINDOW: f64 = 6.9;

/// A model that a search compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VisitedModel {
    /// The type and the place of each effect, sorted.
    pub effects: Vec<(String, On)>,
    /// The log evidence plus the log prior mass, up to a constant that all models of a search share.
    pub log_weight: f64,
}

/// The posterior probability of a type.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Inclusion {
    /// The type.
    pub kind: String,
    /// The probability of all models that contain it.
    pub probability: f64,
    /// The places of its effects, the most probable first, each with the probability of the models that contain it there.
    pub places: Vec<(On, f64)>,
}

/// The average over the models of a search inside the window.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelAverage {
    /// The number of models that were compared, and of those inside the window.
    pub models: [usize; 2],
    /// The probability of the model without effects.
    pub nothing: f64,
    /// The types, the most probable first.
    pub inclusion: Vec<Inclusion>,
}

impl VisitedModel {
    /// The model of these placements.
    pub(super) fn of<'b>(
        candidates: &[Candidate],
        placements: impl Iterator<Item = &'b Placement>,
        log_weight: f64,
    ) -> Self {
        let effect = |p: &Placement| (candidates[p.candidate].kind.clone(), p.on.clone());
        let mut effects: Vec<(String, On)> = placements.map(effect).collect();
        effects.sort();
        Self { effects, log_weight }
    }

    /// The models of a state with each of the weighed placements. `now` is the log weight of the state, `nothing` that
    /// of no further effect on the scale of the placements.
    pub(super) fn around(
        candidates: &[Candidate],
        chosen: &[Placement],
        weighed: &[Weighed],
        [now, nothing]: [f64; 2],
    ) -> Vec<Self> {
        let with = |one: &Weighed| {
            let placements = chosen.iter().chain([&one.placement]);
            Self::of(candidates, placements, now + one.log_weight - nothing)
        };
        let mut all = vec![Self::of(candidates, chosen.iter(), now)];
        all.extend(weighed.iter().map(with));
        all
    }
}

impl ModelAverage {
    /// The average over models; of those that were visited several times, the largest weight counts.
    pub fn of(visited: &[VisitedModel]) -> Self {
        let mut models: Vec<&VisitedModel> =
            visited.iter().filter(|m| m.log_weight.is_finite()).collect();
        models
            .sort_by(|a, b| a.effects.cmp(&b.effects).then(b.log_weight.total_cmp(&a.log_weight)));
        models.dedup_by(|a, b| a.effects == b.effects);
        let compared = models.len();
        let best = models.iter().map(|m| m.log_weight).fold(f64::NEG_INFINITY, f64::max);
        models.retain(|m| m.log_weight > best - WINDOW);
        let total = log_sum(models.iter().map(|m| m.log_weight));
        let probability = |is_one: &dyn Fn(&VisitedModel) -> bool| -> f64 {
            models.iter().filter(|m| is_one(m)).map(|m| (m.log_weight - total).exp()).sum()
        };
        let mut effects: Vec<&(String, On)> = models.iter().flat_map(|m| &m.effects).collect();
        effects.sort();
        effects.dedup();
        let mut inclusion: Vec<Inclusion> = Vec::new();
        for (kind, on) in effects {
            let here = probability(&|m| m.effects.iter().any(|(k, o)| k == kind && o == on));
            match inclusion.iter_mut().find(|one| one.kind == *kind) {
                Some(known) => known.places.push((on.clone(), here)),
                None => inclusion.push(Inclusion {
                    kind: kind.clone(),
                    probability: probability(&|m| m.effects.iter().any(|(k, _)| k == kind)),
                    places: vec![(on.clone(), here)],
                }),
            }
        }
        for one in &mut inclusion {
            one.places.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
        inclusion.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let nothing = probability(&|m| m.effects.is_empty());
        Self { models: [compared, models.len()], nothing, inclusion }
    }

    /// The probability of a type; zero if no model inside the window contains it.
    pub fn probability(&self, kind: &str) -> f64 {
        self.inclusion.iter().find(|one| one.kind == kind).map_or(0.0, |one| one.probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(effects: &[(&str, &[&str])], weight: f64) -> VisitedModel {
        let on = |labels: &[&str]| -> On {
            let labels: Vec<String> = labels.iter().map(|l| (*l).to_owned()).collect();
            if labels.is_empty() { On::new() } else { On::from([("sensor".to_owned(), labels)]) }
        };
        let effects = effects.iter().map(|(kind, labels)| ((*kind).to_owned(), on(labels)));
        VisitedModel { effects: effects.collect(), log_weight: weight.ln() }
    }

    /// Weights 1 : 2 : 3 : 4 by hand; a model that was visited twice counts once, with its larger weight, and one below the
    /// window not at all.
    #[test]
    fn probabilities_are_sums_over_models() {
        let visited = [
            model(&[], 1.0),
            model(&[("gain", &["A"])], 2.0),
            model(&[("gain", &["B"])], 3.0),
            model(&[("delay", &[]), ("gain", &["A"])], 4.0),
            model(&[("delay", &[]), ("gain", &["A"])], 0.5),
            model(&[("echo", &[])], 1e-4),
        ];
        let average = ModelAverage::of(&visited);
        assert_eq!(average.models, [5, 4]);
        assert!((average.nothing - 0.1).abs() < 1e-12);
        assert!((average.probability("gain") - 0.9).abs() < 1e-12);
        assert!((average.probability("delay") - 0.4).abs() < 1e-12);
        assert!(average.probability("echo").abs() < 1e-12);
        let places = &average.inclusion[0].places;
        assert_eq!(places[0].0["sensor"], ["A"]);
        assert!((places[0].1 - 0.6).abs() < 1e-12 && (places[1].1 - 0.3).abs() < 1e-12);
    }
}

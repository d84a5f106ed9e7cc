//! Whether the name stays when a replicate is left out.

use super::leaders::{Desk, Judged};
use crate::gap::experiment::Experiment;
use crate::gap::fit::fit;

/// The number of rivals that are refitted.
const RIVALS: usize = 5;

/// The share of replicates without which the heaviest suspect is of the same type. Evidence by Laplace's method, from
/// the fits to all replicates.
pub fn stability(experiment: &Experiment<'_>, desk: &Desk<'_, '_>, judged: &[Judged]) -> f64 {
    let mut rivals: Vec<&Judged> = Vec::new();
    for j in judged {
        let kind = |j: &Judged| &desk.candidates[j.suspect.candidate].kind;
        if rivals.len() < RIVALS && !rivals.iter().any(|other| kind(other) == kind(j)) {
            rivals.push(j);
        }
    }
    let all: Vec<(usize, usize)> = experiment
        .conditions
        .iter()
        .enumerate()
        .filter(|(_, condition)| condition.replicates.len() > 2)
        .flat_map(|(c, condition)| (0..condition.replicates.len()).map(move |r| (c, r)))
        .collect();
    if all.is_empty() || rivals.len() < 2 {
        return 1.0;
    }
    let stays = |&(c, r): &(usize, usize)| {
        let mut left: Vec<_> = experiment.conditions.iter().map(|c| c.replicates.clone()).collect();
        left[c].remove(r);
        let (_, means) = experiment.with_replicates(left).means();
        let weights: Vec<f64> = rivals
            .iter()
            .map(|rival| {
                let system = desk.with(&rival.suspect);
                let refitted = fit(&system, desk.whitener, &means, &rival.fit.at.point);
                refitted.log_evidence() + desk.log_prior(&rival.suspect)
            })
            .collect();
        weights[1..].iter().all(|w| *w <= weights[0])
    };
    all.iter().filter(|place| stays(place)).count() as f64 / all.len() as f64
}

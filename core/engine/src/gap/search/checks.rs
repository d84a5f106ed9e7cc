//! Checks of a finished search: is an effect the same under all conditions and on all sensors of its group, does its
//! type stay when a replicate is left out, and how probable is each type?
//!
//! An effect of the wrong type often fits because it reproduces what one condition alone shows. The check is the score
//! of a change of its size on a part of the outputs on which it acts (Cox and Hinkley, Theoretical Statistics, section
//! 9.3).

use lacuna::math::special::student_t_cdf;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use crate::gap::candidates::Candidate;
use crate::gap::experiment::Experiment;
use crate::gap::search::refit::{RefitSetting, Weighed};
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit};
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{Projection, differences};

/// The p-value of the hypothesis that each effect is the same under all conditions and on all sensors of its group, by
/// Bonferroni's bound over all parts; 1 if there is nothing to compare.
pub fn consistency(system: &System<'_>, fit: &Fit, whitener: &Whitener) -> f64 {
    let experiment = system.experiment;
    let projection = Projection::of(system, fit);
    let mut rows = Matrix::zeros(0, experiment.outputs());
    let mut unknown = experiment.parameters.len();
    for effect in &system.effects {
        let slope = fit.at.tangents.row(unknown);
        unknown += effect.absent().len();
        for part in parts(system, &effect.acts) {
            let masked = slope.iter().zip(&part).map(|(x, on)| if *on { *x } else { 0.0 });
            rows.push_row(&masked.collect::<Vec<_>>());
        }
    }
    let white = whitener.whiten_rows(&rows);
    let lengths: Vec<f64> = white.iter_rows().map(|row| dot(row, row)).collect();
    let (left, squares) = projection.rest_of_rows(white);
    let (replicates, spread) = differences(experiment);
    let replicates = whitener.whiten_rows(&replicates);
    let freedom = spread.freedom + 4.0;
    let beyond = |t: f64| student_t_cdf(freedom, t.abs()).map(|below| 2.0 * (1.0 - below));
    let (mut least, mut count) = (1.0_f64, 0.0);
    for (j, row) in left.iter_rows().enumerate() {
        let seen = squares[j] > 1e-6 * lengths[j];
        if !seen {
            continue;
        }
        let own: f64 = replicates
            .iter_rows()
            .zip(&spread.weights)
            .map(|(d, w)| w * dot(d, row).powi(2) / squares[j])
            .sum();
        let variance = (4.0 + spread.freedom * own) / freedom;
        // The model's own variance of a score is one; common errors are in it.
        let t = dot(&fit.residual, row) / (squares[j] * variance.max(1.0)).sqrt();
        least = least.min(beyond(t).unwrap_or(1.0));
        count += 1.0;
    }
    if count > 0.0 { (least * count).min(1.0) } else { 1.0 }
}

/// The conditions, and the sensors, into which the outputs where an effect acts can be divided.
fn parts(system: &System<'_>, acts: &[bool]) -> Vec<Vec<bool>> {
    let experiment = system.experiment;
    let of = |chosen: &dyn Fn(&crate::gap::experiment::MeasuredCurve) -> bool| {
        let mut part = vec![false; acts.len()];
        for curve in experiment.curves.iter().filter(|curve| chosen(curve)) {
            curve.measured.iter().filter(|&&i| acts[i]).for_each(|&i| part[i] = true);
        }
        part
    };
    let mut all = Vec::new();
    if experiment.conditions.len() > 1 {
        all.extend((0..experiment.conditions.len()).map(|c| of(&|curve| curve.condition == c)));
    }
    let mut sensors: Vec<&[(String, String)]> = Vec::new();
    for curve in experiment.curves.iter().filter(|c| c.measured.iter().any(|&i| acts[i])) {
        if !sensors.contains(&&curve.labels[..]) {
            sensors.push(&curve.labels);
        }
    }
    if sensors.len() > 1 {
        all.extend(sensors.iter().map(|labels| of(&|curve| curve.labels[..] == **labels)));
    }
    all.retain(|part| part.contains(&true));
    all
}

/// The posterior probability of each type among the placements that were weighed, in decreasing order.
pub(super) fn shares(candidates: &[Candidate], weighed: &[Weighed]) -> Vec<(String, f64)> {
    let best = weighed.first().map_or(0.0, |j| j.log_weight);
    let mut shares: Vec<(String, f64)> = Vec::new();
    for j in weighed {
        let kind = &candidates[j.placement.candidate].kind;
        let weight = (j.log_weight - best).exp();
        match shares.iter_mut().find(|(other, _)| other == kind) {
            Some((_, sum)) => *sum += weight,
            None => shares.push((kind.clone(), weight)),
        }
    }
    let total: f64 = shares.iter().map(|(_, w)| w).sum();
    for (_, w) in &mut shares {
        *w /= total;
    }
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

/// The number of types that are refitted.
const TYPES: usize = 5;

/// The share of replicates without which the type of largest weight stays the same or gives way to a form that contains it,
/// zero to one; evidences by Laplace's method, from the fits to all replicates.
pub fn stability(
    experiment: &Experiment<'_>,
    setting: &RefitSetting<'_, '_>,
    weighed: &[Weighed],
) -> f64 {
    let mut best: Vec<&Weighed> = Vec::new();
    for j in weighed {
        let candidate = |j: &Weighed| &setting.candidates[j.placement.candidate];
        let kind = |j: &Weighed| candidate(j).kind.as_str();
        // A form that contains the first type is no contradiction to it.
        let is_general =
            best.first().is_some_and(|first| candidate(j).contains.contains(&kind(first)));
        if best.len() < TYPES && !is_general && !best.iter().any(|other| kind(other) == kind(j)) {
            best.push(j);
        }
    }
    let all: Vec<(usize, usize)> = experiment
        .conditions
        .iter()
        .enumerate()
        .filter(|(_, condition)| condition.replicates.len() > 2)
        .flat_map(|(c, condition)| (0..condition.replicates.len()).map(move |r| (c, r)))
        .collect();
    if all.is_empty() || best.len() < 2 {
        return 1.0;
    }
    let stays = |&(c, r): &(usize, usize)| {
        let mut left: Vec<_> = experiment.conditions.iter().map(|c| c.replicates.clone()).collect();
        left[c].remove(r);
        let (_, means) = experiment.with_replicates(left).means();
        let weights: Vec<f64> = best
            .iter()
            .map(|one| {
                let system = setting.with(&one.placement);
                let refitted = fit(&system, setting.whitener, &means, &one.fit.at.point);
                refitted.log_evidence() + setting.log_prior(&one.placement)
            })
            .collect();
        weights[1..].iter().all(|w| *w <= weights[0])
    };
    all.iter().filter(|place| stays(place)).count() as f64 / all.len() as f64
}

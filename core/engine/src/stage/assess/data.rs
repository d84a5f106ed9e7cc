//! Checks of the measurements, alone and against the runs.

use std::borrow::Cow;

use lacuna::data::layout::Group;
use lacuna::data::measurements::Summary;
use lacuna::data::{Measurements, Observations, Replicate};
use lacuna::math::moments::{self, mean};
use lacuna_linalg::Matrix;

use crate::assess::Finding;
use crate::assess::envelope::{self, Beside, unanswered};
use crate::assess::replicates::{self, Curves};
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::Measured;
use crate::stage::stream;
use crate::study::Study;

/// Number of draws from the prior that replace the runs of a study without any.
const PRIOR_DRAWS: usize = 64;
/// Length up to which curves are judged together.
const SHORT: usize = 5;

pub(super) fn findings(
    study: &Study,
    problem: &InverseProblem<'_>,
    measured: &Measured,
) -> Vec<Finding> {
    let mut found = Vec::new();
    for block in &measured.used.blocks {
        for group in block.layout.groups() {
            let own: Vec<&Replicate> = curves(block, &group).collect();
            let values = |r: &&'_ Replicate| group.indices.iter().map(|&i| r.values[i]).collect();
            let first = own.iter().take(replicates::MOST);
            let curves: Curves<'_> = first.map(|r| (r.name.as_str(), values(r))).collect();
            found.extend(replicates::duplicates(&group.name, &curves, own.len()));
            found.extend(replicates::symmetric(&group.name, &curves));
        }
    }
    found.extend(dropped(measured));
    let added = study.measurements.as_ref().map_or(0, |m| m.common.added_curves.len());
    found.extend(replicates::added(added, measured.used.replicates()));
    // An effect may shift the response to where no run is.
    if !study.has_effects() {
        found.extend(beside_runs(study, problem, &measured.used));
    }
    found
}

/// Replicates that have values in a group.
fn curves<'a>(block: &'a Measurements, group: &'a Group) -> impl Iterator<Item = &'a Replicate> {
    let is_there = move |r: &&Replicate| group.indices.iter().any(|&i| r.values[i].is_some());
    block.replicates.iter().filter(is_there)
}

fn dropped(measured: &Measured) -> Option<Finding> {
    let left_out = measured.flagged.iter().filter(|curve| curve.left_out).count();
    let of = |block: &Measurements| -> usize {
        block.layout.groups().iter().map(|group| curves(block, group).count()).sum()
    };
    replicates::left_out(left_out, measured.read.blocks.iter().map(of).sum())
}

fn beside_runs(study: &Study, problem: &InverseProblem<'_>, data: &Observations) -> Vec<Finding> {
    let responses = match &problem.data.value.ensemble {
        Some(ensemble) => Cow::Borrowed(&ensemble.responses),
        None => Cow::Owned(at_prior(study, problem)),
    };
    let answered: Vec<usize> =
        (0..responses.rows()).filter(|&i| responses.row(i).iter().all(|y| y.is_finite())).collect();
    let mut found = Vec::new();
    found.extend(unanswered(responses.rows() - answered.len(), responses.rows()));
    let answers = || answered.iter().map(|&i| responses.row(i));
    let groups = study.layouts.groups();
    let short = groups.iter().all(|group| group.indices.len() < SHORT);
    let curves: Vec<(String, Vec<usize>)> = if short {
        vec![(String::new(), (0..study.layouts.len()).collect())]
    } else {
        groups.into_iter().map(|group| (group.name, group.indices)).collect()
    };
    let summaries = data.summaries();
    let stated = super::stated_noise(study);
    found.extend(curves.into_iter().filter_map(|(name, indices)| {
        let measured: Vec<usize> =
            indices.into_iter().filter(|&i| summaries[i].count > 0).collect();
        let own = |i: usize| summaries[i].sd().or_else(|| stated.get(i).copied().flatten());
        // Values of different quantities have no common scatter.
        let common = if short { 0.0 } else { scatter(&summaries, &measured, own, answers()) };
        let error =
            |i: usize| own(i).unwrap_or(0.0).max(common) / (summaries[i].count as f64).sqrt();
        let size = |row: &[f64]| {
            let square: f64 = measured.iter().map(|&i| row[i] * row[i]).sum();
            (square / measured.len().max(1) as f64).sqrt()
        };
        envelope::outside(&Beside {
            name,
            data: measured.iter().map(|&i| (summaries[i].mean, error(i))).collect(),
            runs: ranges(&measured, answers()),
            sizes: answers().map(size).collect(),
        })
    }));
    found
}

/// Smallest and largest response at some outputs.
fn ranges<'r>(outputs: &[usize], runs: impl Iterator<Item = &'r [f64]>) -> Vec<(f64, f64)> {
    let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); outputs.len()];
    for run in runs {
        for (range, &i) in ranges.iter_mut().zip(outputs) {
            *range = (range.0.min(run[i]), range.1.max(run[i]));
        }
    }
    ranges
}

/// Standard deviation that the values of a curve have in common: that between replicates, pooled over the curve; zero if the
/// noise of all values is stated; otherwise that of the curve about the run that is nearest to it, whose oscillations it shares.
fn scatter<'r>(
    summaries: &[Summary],
    measured: &[usize],
    own: impl Fn(usize) -> Option<f64>,
    runs: impl Iterator<Item = &'r [f64]>,
) -> f64 {
    let between: Vec<f64> =
        measured.iter().filter_map(|&i| summaries[i].sd()).map(|sd| sd * sd).collect();
    if !between.is_empty() {
        return mean(&between).sqrt();
    }
    if measured.iter().all(|&i| own(i).is_some()) {
        return 0.0;
    }
    let rest = |run: &[f64]| measured.iter().map(|&i| summaries[i].mean - run[i]).collect();
    let square = |rest: &Vec<f64>| rest.iter().map(|y| y * y).sum::<f64>();
    let rests = runs.map(rest);
    let nearest = rests.min_by(|a: &Vec<f64>, b| square(a).total_cmp(&square(b)));
    nearest.map_or(0.0, |rest| roughness(&rest))
}

/// Standard deviation of white noise on a smooth curve, from the median size of its second differences `y₁ - 2 y₂ + y₃`, whose
/// variance is six times that of the noise; zero for short curves.
fn roughness(values: &[f64]) -> f64 {
    /// Ratio of the standard deviation of a normal distribution to the median of its magnitude.
    const NORMAL: f64 = 1.4826;
    if values.len() < SHORT {
        return 0.0;
    }
    let bends: Vec<f64> = values.windows(3).map(|y| (y[0] - 2.0 * y[1] + y[2]).abs()).collect();
    NORMAL * moments::quantile(&moments::sorted(&bends), 0.5) / 6.0_f64.sqrt()
}

/// Responses at draws from the prior.
fn at_prior(study: &Study, problem: &InverseProblem<'_>) -> Matrix {
    let random = stream(study, "assess").named("prior");
    let point = |i: usize| -> Vec<f64> {
        let mut rng = random.at(i as u64).generator();
        study.prior().sample(&mut rng)
    };
    let points = Matrix::from_rows(study.parameters.len(), (0..PRIOR_DRAWS).map(point));
    problem.forward().mean(&points)
}

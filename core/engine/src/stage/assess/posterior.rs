//! Checks of the draws.

use lacuna::data::Draws;
use lacuna::math::distribution::Distribution;
use lacuna::math::moments::{self, Moments};
use lacuna_linalg::Matrix;

use super::some;
use crate::assess::bounds::{self, AtBound, NEAR};
use crate::assess::chains::{self, Chains};
use crate::assess::{Finding, correlation, estimate, modes, population, prior};
use crate::stage::calibrate::{Calibrated, LikelihoodEstimate, Outcome, PopulationOutcome};
use crate::study::Study;
use crate::study::dependence::Earlier;

pub(super) fn findings(
    study: &Study,
    calibrated: &Calibrated,
    region: Option<&[(f64, f64)]>,
) -> Vec<Finding> {
    let outcome = &calibrated.outcome;
    let draws = calibrated.draws.from_step(outcome.burn_in);
    if draws.is_empty() {
        return Vec::new();
    }
    let mut found = convergence(&draws, outcome);
    if let Some(own) = &outcome.estimate {
        found.extend(of_estimate(own));
    } else if outcome.cut.is_none() {
        found.extend(some([
            unvisited(&draws, outcome),
            modes::unreached(outcome.best_draw.1 - outcome.map_log_density),
        ]));
    }
    found.extend(at_bounds(study, &draws, region));
    found.extend(conflicts(study, &draws));
    found.extend(correlated(study, &draws));
    found.extend(study.dependence_sections.earlier.iter().filter_map(of_run));
    found.extend(outcome.populations.iter().filter_map(of_population));
    found
}

fn of_estimate(own: &LikelihoodEstimate) -> Vec<Finding> {
    if own.deterministic {
        return vec![estimate::deterministic()];
    }
    let variance = estimate::variance(own.variance, own.runs);
    some([variance, own.longest_stay.and_then(estimate::sticking)])
}

fn of_run(run: &Earlier) -> Option<Finding> {
    let check = run.check;
    prior::of_run(
        &run.run.display().to_string(),
        (check.divergence.value, check.divergence.error),
        check.energy.probability,
        run.converged,
        check.is_poor(),
    )
}

fn of_population(found: &PopulationOutcome) -> Option<Finding> {
    let measured = found.members.iter().filter(|member| member.measured).count();
    population::few_groups(&found.parameter, measured, found.scale_range)
}

fn convergence(draws: &Draws, outcome: &Outcome) -> Vec<Finding> {
    let diagnosis = &outcome.diagnosis;
    let judged = diagnosis.coordinates.iter();
    let chains = Chains {
        ensemble: diagnosis.ensemble,
        converged: diagnosis.converged,
        coordinates: judged
            .clone()
            .map(|c| (c.name.clone(), c.r_hat, c.ess_bulk.min(c.ess_tail)))
            .collect(),
        allowed: (diagnosis.criteria.r_hat, diagnosis.criteria.ess),
        advice: diagnosis.advice.join("; "),
    };
    let longest =
        judged.clone().max_by(|a, b| a.autocorrelation_time.total_cmp(&b.autocorrelation_time));
    let sd = |j: usize| moments::variance(&draws.pooled(j)).sqrt();
    let errors = judged.enumerate().map(|(j, c)| c.mcse_mean / sd(j)).filter(|e| e.is_finite());
    let error = errors.fold(0.0, f64::max);
    // Independent draws have no autocorrelation time.
    let longest = longest.filter(|_| diagnosis.criteria.times > 0.0);
    let short =
        longest.and_then(|c| chains::short(&c.name, draws.steps, c.autocorrelation_time, error));
    some([
        chains::not_converged(&chains),
        short,
        chains::stranded(&diagnosis.stranded.to_the_end, draws.chains),
    ])
}

/// Local maxima to which no draw is nearer than to another maximum, in posterior standard deviations.
fn unvisited(draws: &Draws, outcome: &Outcome) -> Option<Finding> {
    if outcome.other_maxima.is_empty() {
        return None;
    }
    let points = draws.points();
    let sd = Moments::of_rows(&points).sd();
    let all: Vec<&[f64]> = std::iter::once(outcome.map.as_slice())
        .chain(outcome.other_maxima.iter().map(|(point, _)| point.as_slice()))
        .collect();
    let distance = |a: &[f64], b: &[f64]| -> f64 {
        let each = a.iter().zip(b).zip(&sd).filter(|(_, sd)| **sd > 0.0);
        each.map(|((a, b), sd)| ((a - b) / sd).powi(2)).sum()
    };
    let mut visited = vec![false; all.len()];
    for point in points.iter_rows() {
        let nearest = (0..all.len())
            .min_by(|&a, &b| distance(point, all[a]).total_cmp(&distance(point, all[b])));
        if let Some(nearest) = nearest {
            visited[nearest] = true;
        }
    }
    let values = std::iter::once(outcome.map_log_density)
        .chain(outcome.other_maxima.iter().map(|(_, value)| *value));
    let missed = values.zip(&visited).filter(|(_, visited)| !**visited);
    let below: Vec<f64> = missed.map(|(value, _)| outcome.map_log_density - value).collect();
    modes::unvisited(&below, all.len())
}

fn at_bounds(study: &Study, draws: &Draws, region: Option<&[(f64, f64)]>) -> Vec<Finding> {
    let mut all = Vec::new();
    // A scale near zero is a result, and no sign of a prior that is too narrow.
    let scale = |j: usize| study.dependence.populations.iter().any(|p| p.scale == j);
    for (j, parameter) in study.parameters.iter().enumerate().filter(|(j, _)| !scale(*j)) {
        let values = draws.pooled(j);
        let support = parameter.prior.support();
        all.extend(of_law(&parameter.name, &parameter.prior, &values));
        if let Some(&(low, high)) = region.and_then(|region| region.get(j)) {
            let inner = Distribution::Uniform([low, high]);
            let own = [(low, low > support.0), (high, high < support.1)];
            let is_own = |at: &AtBound| own.iter().any(|(b, own)| *own && *b == at.bound);
            let of_region = of_law(&parameter.name, &inner, &values).into_iter().filter(is_own);
            all.extend(of_region.map(|at| AtBound { whose: "region".to_owned(), ..at }));
        }
    }
    bounds::at_bound(&all, study.parameters.len())
}

/// Positions of draws relative to the finite bounds of a distribution, on the scale on which it is uniform.
fn of_law(name: &str, law: &Distribution, values: &[f64]) -> Vec<AtBound> {
    let unit: Vec<f64> = values.iter().map(|&x| law.cdf(x)).collect();
    let sd = moments::variance(&unit).sqrt();
    let (low, high) = law.support();
    let share = |near: &dyn Fn(f64) -> bool| {
        unit.iter().filter(|&&u| near(u)).count() as f64 / unit.len() as f64
    };
    let at = |bound: f64, share: f64| AtBound {
        name: name.to_owned(),
        bound,
        whose: "prior".to_owned(),
        share,
        natural: low.is_infinite() || high.is_infinite(),
    };
    let mut found = Vec::new();
    if low.is_finite() && sd > 0.0 {
        found.push(at(low, share(&|u| u < NEAR * sd)));
    }
    if high.is_finite() && sd > 0.0 {
        found.push(at(high, share(&|u| 1.0 - u < NEAR * sd)));
    }
    found
}

fn conflicts(study: &Study, draws: &Draws) -> Vec<Finding> {
    let one = |(j, parameter): (usize, &lacuna::data::Parameter)| {
        let (low, high) = parameter.prior.support();
        if low.is_finite() || high.is_finite() {
            return None;
        }
        let values = draws.pooled(j);
        let posterior = (moments::mean(&values), moments::variance(&values).sqrt());
        let law = (parameter.prior.mean(), parameter.prior.variance().sqrt());
        prior::conflict(&parameter.name, law, posterior)
    };
    study.parameters.iter().enumerate().filter_map(one).collect()
}

fn correlated(study: &Study, draws: &Draws) -> Option<Finding> {
    let d = study.parameters.len();
    let names: Vec<String> = study.parameters.iter().map(|p| p.name.clone()).collect();
    let covariance = Moments::of_rows(&draws.points()).covariance();
    let scale = |p: &lacuna::data::Parameter| {
        let sd = p.prior.variance().sqrt();
        // Heavy-tailed distributions have no standard deviation: a quarter of the central 95 % range replaces it.
        if sd.is_finite() && sd > 0.0 {
            sd
        } else {
            0.25 * (p.prior.quantile(0.975) - p.prior.quantile(0.025))
        }
    };
    let sd: Vec<f64> = study.parameters.iter().map(scale).collect();
    let scaled = Matrix::from_fn(d, d, |i, j| covariance[(i, j)] / (sd[i] * sd[j]));
    correlation::correlated(&names, &scaled)
}

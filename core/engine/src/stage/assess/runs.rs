//! Checks of the simulation runs.

use lacuna::data::{Ensemble, Parameter};
use lacuna::math::moments;
use lacuna::plugin::Emulator;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::assess::Finding;
use crate::assess::runs::{self as check, Invalid};
use crate::assess::suspicious::{self, LeftOut, Suspect, values};
use crate::stage::calibrate::Calibrated;
use crate::stage::idle;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::outside;
use crate::stage::surrogate::{Fitted, Fitting};
use crate::study::Study;
use crate::study::file::InvalidRuns;

/// Findings about the runs; `shift` is the shift of the estimates by the emulator's error, in posterior standard
/// deviations.
pub(super) fn findings(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Calibrated>,
    shift: Option<f64>,
) -> Result<Vec<Finding>, Stop> {
    let mut found = Vec::new();
    if let Some(ensemble) = &problem.data.value.ensemble {
        found.extend(few(study, problem, calibrated, shift));
        found.extend(beyond(study, problem, calibrated));
        found.extend(at_edge(study, problem, calibrated, shift));
        found.extend(sparse(study, problem, calibrated, shift));
        found.extend(of_design(study, ensemble));
        found.extend(invalid(study, ensemble));
        let failed = ensemble.failed.len();
        found.extend(check::failed(failed, failed + ensemble.runs.len()));
        found.extend(suspicious(study, problem, ensemble)?);
    }
    // An effect may use a parameter that the model does not use.
    if calibrated.is_some() && !study.has_effects() {
        let idle = idle::parameters(study)?;
        found.extend(idle.iter().map(|&i| check::idle(&study.parameters[i].name)));
    }
    Ok(found)
}

/// Parameters of the training runs, `runs x parameters`; of thousands of runs evenly spaced ones.
fn training(problem: &InverseProblem<'_>) -> Option<Matrix> {
    let fitted = &problem.fitted()?.value;
    let count = fitted.sample_points.rows() - fitted.errors.validation;
    Some(fitted.sample_points.select_rows(&(0..count).collect::<Vec<_>>()))
}

fn few(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Calibrated>,
    shift: Option<f64>,
) -> Option<Finding> {
    calibrated?;
    let points = training(problem)?;
    let middle = |p: &Parameter| (p.prior.quantile(0.005), p.prior.quantile(0.995));
    let whole = || study.parameters.iter().map(middle).collect();
    let intervals: Vec<(f64, f64)> = problem.region().map_or_else(whole, <[_]>::to_vec);
    let own = inputs(study).swap_remove(0);
    let inside = |point: &&[f64]| {
        own.iter().all(|&j| intervals[j].0 <= point[j] && point[j] <= intervals[j].1)
    };
    let all = problem.fitted()?.value.errors.training;
    let inside = points.iter_rows().filter(inside).count() * all / points.rows().max(1);
    check::few_in_prior(inside, all, own.len(), shift)
}

/// Finding about the distance of the posterior mean from its (d + 1)-th nearest training run, for d parameters,
/// relative to the median of the same distance between runs.
fn sparse(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Calibrated>,
    shift: Option<f64>,
) -> Option<Finding> {
    let (points, calibrated) = (training(problem)?, calibrated?);
    let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
    let mean: Vec<f64> =
        (0..study.parameters.len()).map(|j| moments::mean(&draws.pooled(j))).collect();
    let scale = Scale::of(study, &points);
    let of = |own: Vec<usize>| ratio_of_distances(&points, &mean, &scale, &own);
    let largest = inputs(study).into_iter().map(of).collect::<Option<Vec<f64>>>()?;
    check::sparse(largest.into_iter().fold(f64::NEG_INFINITY, f64::max), shift)
}

/// Places of the parameters of the emulator, once for each set of values with which it is evaluated.
fn inputs(study: &Study) -> Vec<Vec<usize>> {
    match &study.hierarchy.trained {
        Some(trained) => trained.parts.iter().map(|part| part.parameters.clone()).collect(),
        None => vec![(0..study.parameters.len()).collect()],
    }
}

/// Distance of a point from its (d + 1)-th nearest run relative to the median of the same distance between runs, in these d
/// parameters; `None` for too few runs.
fn ratio_of_distances(points: &Matrix, mean: &[f64], scale: &Scale, own: &[usize]) -> Option<f64> {
    let (runs, d) = (points.rows(), own.len());
    if runs <= d + 2 {
        return None;
    }
    let unit =
        |point: &[f64]| -> Vec<f64> { own.iter().map(|&j| scale.unit(j, point[j])).collect() };
    let all: Vec<Vec<f64>> = points.iter_rows().map(unit).collect();
    let distance = |from: &[f64], without: Option<usize>| {
        let others = all.iter().enumerate().filter(|(i, _)| Some(*i) != without);
        let squares: Vec<f64> =
            others.map(|(_, to)| from.iter().zip(to).map(|(a, b)| (a - b).powi(2)).sum()).collect();
        moments::sorted(&squares)[d].sqrt()
    };
    let usual: Vec<f64> =
        all.iter().enumerate().map(|(i, point)| distance(point, Some(i))).collect();
    Some(distance(&unit(mean), None) / moments::quantile(&moments::sorted(&usual), 0.5))
}

/// Applies a check to each parameter: to its prior, the range of its training runs with their number, and its draws.
fn by_parameter(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Calibrated>,
    check: impl Fn(&Parameter, (f64, f64, usize), &[f64]) -> Vec<Finding>,
) -> Vec<Finding> {
    let (Some(points), Some(calibrated)) = (training(problem), calibrated) else {
        return Vec::new();
    };
    let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
    let one = |(j, parameter): (usize, &Parameter)| {
        let column = points.column(j);
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        check(parameter, (low, high, column.len()), &draws.pooled(j))
    };
    // Location and scale of a population are no inputs of the emulator.
    let inputs = study.parameters.iter().enumerate();
    inputs.filter(|(j, _)| !study.unknowns[*j].of_population()).flat_map(one).collect()
}

fn share(values: &[f64], is: impl Fn(f64) -> bool) -> f64 {
    values.iter().filter(|&&x| is(x)).count() as f64 / values.len() as f64
}

/// Finding about draws that lie beyond all training runs by more than one step between runs.
fn beyond(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Calibrated>,
) -> Vec<Finding> {
    by_parameter(study, problem, calibrated, |parameter, (low, high, runs), draws| {
        let step = (high - low) / runs as f64;
        let outside = share(draws, |x| x < low - step || x > high + step);
        check::extrapolated(&parameter.name, outside, (low, high)).into_iter().collect()
    })
}

/// Finding about draws at an end of the runs, if the runs do not extend beyond the prior.
fn at_edge(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Calibrated>,
    shift: Option<f64>,
) -> Vec<Finding> {
    let (near, margin) = check::AT_EDGE;
    by_parameter(study, problem, calibrated, |parameter, (low, high, _), draws| {
        let range = high - low;
        let (first, last) = parameter.prior.support();
        // Each end of the runs, the inward direction, and how far the runs extend beyond the prior.
        let ends = [(low, 1.0, first - low), (high, -1.0, high - last)];
        let without = ends.iter().filter(|(.., own)| own.is_finite() && *own < margin * range);
        let finding = |&(end, inward, _): &(f64, f64, f64)| {
            let there = share(draws, |x| inward * (x - end) < near * range);
            check::no_margin(&parameter.name, there, end, shift)
        };
        without.filter_map(finding).collect()
    })
}

fn of_design(study: &Study, ensemble: &Ensemble) -> Option<Finding> {
    let outside = outside::runs(&study.parameters, ensemble);
    let mut rows: Vec<usize> = outside.iter().map(|o| o.run).collect();
    rows.dedup();
    let concerned = study.parameters.iter().enumerate();
    let concerned: Vec<String> = concerned
        .filter(|(j, _)| outside.iter().any(|o| o.parameter == *j))
        .map(|(_, p)| p.name.clone())
        .collect();
    check::outside_design(rows.len(), ensemble.runs.len(), &concerned)
}

fn invalid(study: &Study, ensemble: &Ensemble) -> Option<Finding> {
    let inside = |i: &usize| {
        let point = ensemble.points.row(*i);
        study.prior().allows(point)
    };
    let all: Vec<usize> = (0..ensemble.runs.len()).collect();
    let in_prior: Vec<usize> = all.iter().copied().filter(inside).collect();
    let count = |rows: &[usize]| (rows.iter().filter(|&&i| !ensemble.valid[i]).count(), rows.len());
    let kept = study.surrogate.as_ref().map(|s| s.common.invalid_runs).unwrap_or_default();
    check::invalid(&Invalid {
        all: count(&all),
        in_prior: count(&in_prior),
        trained: kept == InvalidRuns::Train,
    })
}

/// Largest number of values for which repeated fits use all outputs; beyond it a subset of the outputs is used.
const MOST: usize = 10_000_000;

fn suspicious(
    study: &Study,
    problem: &InverseProblem<'_>,
    ensemble: &Ensemble,
) -> Result<Vec<Finding>, Stop> {
    let Some(learned) = problem.emulated() else { return Ok(Vec::new()) };
    // With runs that follow the data, those of the last fit are not those of the design.
    let follows = problem.refinement().is_some() || problem.region().is_some();
    let rows: Vec<usize> = if follows {
        (0..ensemble.runs.len()).filter(|&i| ensemble.valid[i]).collect()
    } else {
        Fitting::of(study, ensemble)?.training
    };
    // The runs of all groups are the same runs.
    let own = inputs(study).swap_remove(0);
    let outputs: Vec<usize> = match &study.hierarchy.trained {
        Some(trained) => trained.parts[0].outputs.iter().flat_map(|(_, to)| to.clone()).collect(),
        None => (0..ensemble.layouts.len()).collect(),
    };
    let step = (rows.len() * outputs.len()).div_ceil(MOST).max(1);
    let columns: Vec<usize> = outputs.into_iter().step_by(step).collect();
    let responses = ensemble.responses.select(&rows, &columns);
    let raw = ensemble.points.select_rows(&rows);
    let scale = Scale::of(study, &raw);
    let points =
        Matrix::from_fn(raw.rows(), own.len(), |i, k| scale.unit(own[k], raw[(i, own[k])]));
    let left_out = (!follows).then(|| {
        let own: Vec<usize> = (0..rows.len()).collect();
        left_out(&learned.fitted.value, &*learned.emulator, &own, &columns)
    });
    let suspects = suspicious::suspects(&points, &responses, left_out.as_ref());
    let told = |suspect: &Suspect| {
        let row = rows[suspect.run];
        let value = suspect.parameter.map(|(k, unit)| {
            let j = own[k];
            (study.parameters[j].name.as_str(), ensemble.points[(row, j)], scale.natural(j, unit))
        });
        suspicious::suspicious(&ensemble.runs[row], suspect, value)
    };
    // A single wrong value makes its whole run an outlier: then the value is reported.
    let wrong = match columns.len() {
        1 => Vec::new(),
        _ => values::values(&points, &responses, left_out.as_ref()),
    };
    let whole = suspects.iter().filter(|s| wrong.iter().all(|value| value.run != s.run));
    let mut found: Vec<Finding> = whole.map(told).collect();
    found.extend(wrong.iter().map(|value| {
        let (row, column) = (rows[value.run], columns[value.output]);
        let place = ensemble.layouts.describe(column);
        let number = ensemble.responses[(row, column)];
        values::suspicious(&ensemble.runs[row], &place, number, value)
    }));
    Ok(found)
}

/// Leave-one-out errors of the emulator at its training runs: from a fit without the run if the emulator states how
/// large they may be.
fn left_out(
    fitted: &Fitted,
    emulator: &dyn Emulator,
    runs: &[usize],
    outputs: &[usize],
) -> LeftOut {
    let known = fitted.sample_points.rows() - fitted.errors.validation;
    // Of thousands of runs the stage keeps the errors of some, the emulator those of all.
    let some = known < runs.len();
    let stated = fitted.curves.stated.as_ref().filter(|_| !some);
    let Some(stated) = stated else {
        let errors = if some {
            emulator.left_out(runs, outputs)
        } else {
            fitted.samples().select(runs, outputs)
        };
        return LeftOut { errors, sizes: vec![1.0; runs.len()] };
    };
    let errors = fitted.curves.errors.select(runs, outputs);
    let variances = stated.select(runs, outputs);
    let of_output = |j: usize| moments::mean(&variances.column(j));
    let means: Vec<f64> = (0..outputs.len()).map(of_output).collect();
    let relative = |row: &[f64]| {
        let each = row.iter().zip(&means).filter(|(_, mean)| **mean > 0.0);
        let ratios: Vec<f64> = each.map(|(v, mean)| v / mean).collect();
        if ratios.is_empty() { 1.0 } else { moments::mean(&ratios).sqrt().max(1e-3) }
    };
    let sizes = variances.iter_rows().map(relative).collect();
    LeftOut { errors, sizes }
}

/// Map from natural values to the unit interval: by the design distribution, or by the range of the runs if these
/// extend beyond it.
struct Scale<'a> {
    study: &'a Study,
    ranges: Vec<(f64, f64)>,
}

impl<'a> Scale<'a> {
    fn of(study: &'a Study, points: &Matrix) -> Self {
        let range = |j: usize| {
            let column = points.column(j);
            let low = column.iter().copied().fold(f64::INFINITY, f64::min);
            (low, column.iter().copied().fold(f64::NEG_INFINITY, f64::max))
        };
        Self { study, ranges: (0..points.columns()).map(range).collect() }
    }

    fn by_law(&self, j: usize) -> bool {
        let (low, high) = self.study.parameters[j].design.support();
        low <= self.ranges[j].0 && self.ranges[j].1 <= high
    }

    fn unit(&self, j: usize, x: f64) -> f64 {
        if self.by_law(j) {
            return self.study.parameters[j].design.cdf(x);
        }
        let (low, high) = self.ranges[j];
        if high > low { (x - low) / (high - low) } else { 0.5 }
    }

    fn natural(&self, j: usize, unit: f64) -> f64 {
        if self.by_law(j) {
            return self.study.parameters[j].design.quantile(unit.clamp(0.001, 0.999));
        }
        let (low, high) = self.ranges[j];
        low + unit * (high - low)
    }
}

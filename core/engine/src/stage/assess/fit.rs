//! Checks of the calibrated model against the data.

use lacuna::data::Observations;
use lacuna::data::measurements::Summary;
use lacuna::math::moments::mean;
use lacuna::math::random::Stream;
use rayon::prelude::*;

use super::{Judged, series, some};
use crate::assess::fit::{self as check, Against};
use crate::assess::{Finding, residuals};
use crate::stage::artifacts::Artifacts;
use crate::stage::validate::Validated;
use crate::stage::validate::ValidationCase;
use crate::stage::{predict, stream};

/// Number of posterior draws at which data are simulated.
const SIMULATED: usize = 100;
/// Number of these used for the autocorrelation of residuals.
const CORRELATED: usize = 40;
/// Number of replicates from which on a 95 % interval is meaningful.
const REPLICATES: usize = 3;
/// Number of data above which those of simulated data that need only counts, means and scatters are drawn without the data,
/// if the data are more than this number of times as many as the outputs.
const MANY: usize = 1_000_000;
const MANY_TIMES: usize = 100;

pub(super) fn findings(judged: &Judged<'_>, all: &Artifacts<'_>) -> Vec<Finding> {
    let mut found = simulated(judged);
    if let Some(validated) = all.validated.map(|kept| &kept.value) {
        found.extend(some([
            reference(judged, validated),
            form(judged, validated),
            covered(judged, validated),
            accurate(judged, validated),
        ]));
    }
    found
}

fn case<'a>(validated: &'a Validated, name: &str) -> Option<&'a ValidationCase> {
    validated.cases.iter().find(|case| case.name == name)
}

fn reference(judged: &Judged<'_>, validated: &Validated) -> Option<Finding> {
    let (map, reference) = (case(validated, "map")?, case(validated, "reference")?);
    // The responses of the cases are those of the model without effects; only comparable responses are compared.
    if map.simulated != reference.simulated || judged.study.has_effects() {
        return None;
    }
    let hyper = judged.hyper(&judged.calibrated.outcome.map);
    let value = |case: &ValidationCase| judged.likelihood.log_likelihood(&case.response, hyper);
    check::reference(&Against {
        log_likelihood: (value(map), value(reference)),
        rmse: (map.rmse, reference.rmse),
        simulated: map.simulated,
    })
}

fn form(judged: &Judged<'_>, validated: &Validated) -> Option<Finding> {
    let of = |origin: &str| validated.spread.iter().find(|(o, _)| o == origin).map(|(_, sd)| *sd);
    if let (Some(form), Some(measurement)) = (of("model_form"), of("measurement")) {
        return check::model_form(form, measurement);
    }
    let (all, noise) = (of("discrepancy")?, of("replicates").or_else(|| stated_noise(judged))?);
    let rest = (all * all - noise * noise).max(0.0).sqrt();
    check::model_form(rest, noise)
}

/// Root mean square of the noise that the study states; `None` unless it does for every output.
fn stated_noise(judged: &Judged<'_>) -> Option<f64> {
    let outputs = super::stated_noise(judged.study).into_iter();
    let squares: Option<Vec<f64>> = outputs.map(|sd| sd.map(|sd| sd * sd)).collect();
    squares.filter(|squares| !squares.is_empty()).map(|squares| mean(&squares).sqrt())
}

fn covered(judged: &Judged<'_>, validated: &Validated) -> Option<Finding> {
    let (low, high) = validated.predictive.as_ref()?;
    let (mut inside, mut all) = (0, 0);
    for (block, range) in judged.measured.used.blocks.iter().zip(judged.study.layouts.ranges()) {
        for replicate in &block.replicates {
            for (i, y) in range.clone().zip(&replicate.values) {
                if let Some(y) = y {
                    all += 1;
                    inside += usize::from(low[i] <= *y && *y <= high[i]);
                }
            }
        }
    }
    check::covered(inside, all)
}

fn accurate(judged: &Judged<'_>, validated: &Validated) -> Option<Finding> {
    let map = case(validated, "map").filter(|case| !case.accuracy.is_empty())?;
    let counts: Vec<usize> = judged.measured.used.summaries().iter().map(|s| s.count).collect();
    let measured = counts.iter().filter(|&&n| n > 0).count();
    let replicated = counts.iter().filter(|&&n| n >= REPLICATES).count();
    // The responses of the cases are without effects.
    if 2 * replicated < measured || judged.study.has_effects() {
        return None;
    }
    check::accurate(map.average)
}

/// Posterior predictive checks against data simulated at posterior draws.
fn simulated(judged: &Judged<'_>) -> Vec<Finding> {
    let outcome = &judged.calibrated.outcome;
    let draws = judged.calibrated.draws.from_step(outcome.burn_in);
    if draws.is_empty() {
        return Vec::new();
    }
    let outputs = judged.response.len();
    let count = predict::affordable(SIMULATED.min(draws.len()), outputs);
    let points = draws.points().select_rows(&predict::spaced(count, draws.len()));
    let random = stream(judged.study, "assess").named("simulate");
    let variance = judged.variance();
    let look = Look { judged, variance: &variance };
    // With the error of the replicates' mean, the correlation within a replicate is in the covariance of the mean
    // curve.
    let allowed = judged.study.discrepancy.as_ref().is_some_and(|d| d.common.replicate_error);
    let replicated = judged.measured.used.blocks.iter().all(|b| b.replicates.len() >= REPLICATES);
    let correlated = !(allowed && replicated);
    let data = &judged.measured.likelihood;
    let values = data.count();
    let many = values > MANY && values > MANY_TIMES * outputs;
    let one = |(i, response): (usize, &Vec<f64>)| {
        let hyper = judged.hyper(points.row(i));
        let random: Stream = random.at(i as u64);
        let timed = correlated && i < CORRELATED;
        let summaries = (many && !timed)
            .then(|| judged.predictive.simulate_summaries(response, hyper, &random))
            .flatten();
        if let Some(summaries) = summaries {
            let all = summaries.concat();
            return (look.misfit(&all, response), None, look.against_scatter(&all, response));
        }
        let data = Observations { blocks: judged.predictive.simulate(response, hyper, &random) };
        let time = timed.then(|| look.time(&data, response)).flatten();
        let all = data.summaries();
        (look.misfit(&all, response), time, look.against_scatter(&all, response))
    };
    let mut made: Vec<(f64, Option<f64>, f64)> = Vec::with_capacity(count);
    let draws: Vec<usize> = (0..count).collect();
    for some in draws.chunks(predict::together(judged.problem.forward())) {
        let responses = judged.responses(&points.select_rows(some));
        made.par_extend(some.par_iter().copied().zip(&responses).map(one));
    }
    let misfits: Vec<f64> = made.iter().map(|m| m.0).filter(|m| m.is_finite()).collect();
    let times: Vec<f64> = made.iter().filter_map(|m| m.1).collect();
    let ratios: Vec<f64> = made.iter().map(|m| m.2).filter(|f| f.is_finite()).collect();
    let time = correlated.then(|| look.time(data, &judged.response)).flatten();
    let used = &judged.measured.used;
    let (effective, replicates) = look.independent(used);
    some([
        check::misfit(look.misfit(&data.summaries(), &judged.response), &misfits),
        check::scatter(
            look.against_scatter(&used.summaries(), &judged.response),
            &ratios,
            effective,
            replicates,
        ),
        time.and_then(|time| residuals::correlated(time, &times, data.count())),
    ])
}

/// Statistics of data relative to a response.
struct Look<'a> {
    judged: &'a Judged<'a>,
    /// Variance of a new replicate, one value per output.
    variance: &'a [f64],
}

impl Look<'_> {
    /// Mean square of the difference between the replicates' mean and the response, in units of its standard error.
    fn misfit(&self, summaries: &[Summary], response: &[f64]) -> f64 {
        let each = summaries.iter().zip(response).zip(self.variance);
        let term =
            |((s, r), v): ((&Summary, &f64), &f64)| s.count as f64 * (s.mean - r).powi(2) / v;
        let squares: Vec<f64> =
            each.filter(|((s, _), v)| s.count > 0 && **v > 0.0).map(term).collect();
        squares.iter().sum::<f64>() / squares.len().max(1) as f64
    }

    /// Mean square of the difference between the replicates' mean and the response, divided by its variance according
    /// to the replicates' scatter; NaN without replicates.
    fn against_scatter(&self, summaries: &[Summary], response: &[f64]) -> f64 {
        let each = summaries.iter().zip(response).zip(self.variance);
        let (mut above, mut below, mut count) = (0.0, 0.0, 0.0);
        for ((s, r), v) in each.filter(|((s, _), v)| s.count >= REPLICATES && **v > 0.0) {
            let n = s.count as f64;
            above += n * (s.mean - r).powi(2) / v;
            below += s.scatter / (n - 1.0) / v;
            count += 1.0;
        }
        if count > 0.0 { above / below } else { f64::NAN }
    }

    /// Effective number of independent values in the curves according to the correlation of the replicates about their
    /// mean, and the mean number of replicates.
    fn independent(&self, data: &Observations) -> (f64, f64) {
        let summaries = data.summaries();
        let replicated: Vec<f64> =
            summaries.iter().filter(|s| s.count >= REPLICATES).map(|s| s.count as f64).collect();
        let means: Vec<f64> = summaries.iter().map(|s| s.mean).collect();
        let time = self.time(data, &means).unwrap_or(1.0).max(1.0);
        let outputs = replicated.len() as f64;
        (outputs / time, replicated.iter().sum::<f64>() / outputs)
    }

    /// Autocorrelation time of residuals along the last axis, in steps, over all curves together and about zero.
    fn time(&self, data: &Observations, response: &[f64]) -> Option<f64> {
        let ranges: Vec<_> = self.judged.study.layouts.ranges().collect();
        series::time(|each| {
            for (block, range) in data.blocks.iter().zip(&ranges) {
                let (response, variance) =
                    (&response[range.clone()], &self.variance[range.clone()]);
                series::of(block, response, variance, each);
            }
        })
    }
}

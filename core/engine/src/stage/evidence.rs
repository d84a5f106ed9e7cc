//! Stage 6: evidence of the study, and leave-one-out predictions of each datum and each curve.
//!
//! [`compare`](crate::compare) compares these results for several studies of the same data.

mod kept;
mod sampled;

use lacuna::data::Draws;
use lacuna::diagnose::leave_one_out::{LeaveOneOut, probabilities_below};
use lacuna::plugin::sampler::Evidence;
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;

use super::calibrate::Calibrated;
use super::curves::{self, Curves};
use super::pieces::Pieces;
use super::predictions::{self, Chosen, Predicting, Predictor};
use super::sampling::broken;
use super::stream;
use crate::page::number::significant;
use crate::posterior::Posterior;
use crate::posterior::bridge::Bridge;
use crate::study::Study;

pub use kept::{curves_left_out, left_out};

/// Measures of a study as a whole.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Weighed {
    /// Evidence, if it could be estimated.
    pub evidence: Option<Evidence>,
    /// Leave-one-out prediction of each datum, if the discrepancy supports it.
    pub left_out: Option<LeaveOneOut>,
    /// Probability of a value below the measured one under the leave-one-out prediction of each datum; empty if it is
    /// not known.
    pub below: Vec<f64>,
    /// Leave-one-out prediction of each curve, if the discrepancy supports it and there are several.
    pub curves_left_out: Option<LeaveOneOut>,
    /// Log density of each curve given all other data and the parameters, at the draws of [`Chosen`]
    /// (`draws x curves`).
    pub by_curve: Option<Matrix>,
    /// Reasons why something is missing or incomplete.
    pub missing: Vec<String>,
}

/// Estimates the evidence and the predictive measures of a calibrated study.
pub fn stage(
    study: &Study,
    posterior: &Posterior<'_>,
    calibrated: &Kept<Calibrated>,
    predictor: Option<&Predictor<'_>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Weighed>, Stop> {
    observer.begin(Stage::Evidence.label(), "piece", 0);
    let faults = run.watched().to_vec();
    let kept = run.keep(
        &Stage::Evidence.folder(),
        &json!([calibrated.hash, study.about.seed]),
        observer,
        |folder| {
            let mut pieces = Pieces::open(folder, &faults, observer)?;
            let draws = calibrated.value.draws.from_step(calibrated.value.outcome.burn_in);
            let mut missing = Vec::new();
            let outcome = &calibrated.value.outcome;
            let evidence = match &outcome.evidence {
                Some(evidence) => Some(evidence.clone()),
                None if outcome.cut.is_some() => {
                    missing.push("no evidence: the data do not update all parameters".to_owned());
                    None
                }
                None if outcome.estimate.is_some() => {
                    let text = "no evidence: bridge sampling needs a density that is not estimated";
                    missing.push(format!("{text}; use a sampler that gives the evidence itself"));
                    None
                }
                None => bridged(study, posterior, &draws, &mut pieces)?
                    .map_err(|reason| missing.push(format!("no evidence: {reason}")))
                    .ok(),
            };
            let weighed = Weighed { evidence, missing, ..Weighed::default() };
            // Given all other data the distribution of a cut parameter is not that of left-out data.
            let weighed = match predictor.filter(|_| outcome.cut.is_none()) {
                Some(p) => weighed.predicting(study, p, &calibrated.value, &mut pieces)?,
                None => weighed,
            };
            pieces.finish()?;
            Ok(weighed)
        },
    )?;
    observer.end(Stage::Evidence.label(), &summary(&kept.value));
    Ok(kept)
}

fn summary(weighed: &Weighed) -> String {
    let evidence = weighed.evidence.as_ref();
    let mut parts: Vec<String> = evidence
        .map(|e| format!("log evidence {:.2} ± {}", e.log, significant(e.error, 2)))
        .into_iter()
        .collect();
    let loo = weighed.left_out.as_ref();
    let error = |l: &LeaveOneOut| l.error_by_curve.unwrap_or(l.error);
    parts.extend(loo.map(|l| format!("elpd_loo {:.1} ± {:.1}", l.elpd, error(l))));
    parts.extend(weighed.missing.iter().cloned());
    parts.join(", ")
}

/// Number of points at which the density is computed together.
const TOGETHER: usize = 512;

/// The evidence by bridge sampling, or the reason why it cannot be estimated.
fn bridged(
    study: &Study,
    posterior: &Posterior<'_>,
    draws: &Draws,
    pieces: &mut Pieces<'_>,
) -> Result<Result<Evidence, String>, Stop> {
    let draws = coordinates(posterior, &thinned(draws));
    let bridge = match Bridge::new(posterior, &draws, &stream(study, "evidence")) {
        Ok(bridge) => bridge,
        Err(reason) => return Ok(Err(reason)),
    };
    let count = bridge.count();
    pieces.announce(count.div_ceil(TOGETHER));
    let mut densities = Vec::with_capacity(count);
    for first in (0..count).step_by(TOGETHER) {
        let some = first..count.min(first + TOGETHER);
        densities.extend(pieces.next(|| {
            let found = bridge.log_density(some);
            broken(posterior).map(|()| found)
        })?);
    }
    let with_prior = |found: Evidence| {
        let error = found.error.hypot(posterior.prior().log_error());
        Evidence { error, ..found }
    };
    Ok(bridge.evidence(&densities).map(with_prior))
}

/// Approximate number of draws from which the evidence is estimated.
const WEIGHED: usize = 20_000;

/// Some of the chains, at least four, and only the last steps of long chains.
fn thinned(draws: &Draws) -> Draws {
    let wanted = (WEIGHED / draws.steps.max(1)).clamp(4.min(draws.chains), draws.chains);
    let stride = draws.chains / wanted.max(1);
    let chains: Vec<usize> = (0..wanted).map(|i| i * stride).collect();
    let some = draws.of_chains(&chains);
    let most = WEIGHED / wanted.max(1);
    some.from_step(some.steps.saturating_sub(most))
}

/// The draws in the posterior's own coordinates.
fn coordinates(posterior: &Posterior<'_>, draws: &Draws) -> Draws {
    let mut draws = draws.clone();
    let d = draws.dimension();
    for point in draws.values.chunks_exact_mut(d) {
        let values = posterior.coordinates(point);
        point.copy_from_slice(&values);
    }
    draws
}

/// Largest number of data evaluations for leaving out all curves at all draws.
const WORK: usize = 1 << 33;

impl Weighed {
    /// Adds the leave-one-out predictions.
    fn predicting(
        mut self,
        study: &Study,
        predictor: &Predictor<'_>,
        calibrated: &Calibrated,
        pieces: &mut Pieces<'_>,
    ) -> Result<Self, Stop> {
        let p = &predictor.densities;
        let data = p.data.count();
        let many = data > sampled::MANY;
        let chosen = Chosen::of(calibrated, if many { sampled::SIZE } else { data });
        let responses = predictions::responses(study, p, &chosen, pieces)?;
        let some = if many {
            self.of_sample(study, p, &chosen, responses.as_deref(), pieces)?
        } else {
            self.of_all(study, predictor, &chosen, responses.as_deref(), pieces)?
        };
        if !some {
            return Ok(self);
        }
        let whole = curves::beginnings(p.data).filter(|first| *first).count();
        let count = chosen.points.rows();
        let work = |curves: usize| curves.saturating_mul(count).saturating_mul(data);
        let curves = (work(whole) <= WORK).then(|| Curves::of(p.data));
        let number = curves.as_ref().map_or(whole, |curves| curves.all.len());
        let curves = curves.filter(|_| work(number) <= WORK);
        let (Some(responses), Some(curves)) = (responses, curves) else {
            self.missing.push(format!(
                "leave-one-out predictions of curves are omitted: {number} curves of {data} data are too many"
            ));
            return Ok(self);
        };
        let names = p.likelihood.hyperparameters();
        let d = chosen.points.columns();
        let own: Vec<usize> = (d - names.len()..d).collect();
        let hyper = chosen.points.select_columns(&own);
        let ranges: Vec<_> = study.layouts.ranges().collect();
        let unknowns = (names, &hyper);
        self.by_curve = if curves.all.is_empty() {
            None
        } else {
            curves::left_out(&curves.all, &p.law, p.data, &ranges, &responses, unknowns, pieces)?
        };
        let of = |densities| LeaveOneOut::of(densities, chosen.efficiency, Vec::new());
        self.curves_left_out = self.by_curve.as_ref().map(of);
        Ok(self)
    }

    /// Adds the prediction of each datum; false if the discrepancy has none.
    fn of_all(
        &mut self,
        study: &Study,
        predictor: &Predictor<'_>,
        chosen: &Chosen,
        responses: Option<&[Vec<f64>]>,
        pieces: &mut Pieces<'_>,
    ) -> Result<bool, Stop> {
        let p = &predictor.densities;
        let Some(densities) = predictions::pointwise(study, p, chosen, responses, pieces)? else {
            return Ok(false);
        };
        if !chosen.written {
            let (data, count) = (p.data.count(), chosen.points.rows());
            self.missing.push(format!(
                "leave-one-out predictions of {data} data use {count} draws and are too many to be written to \
                 `posterior.nc`"
            ));
        }
        if let Some(responses) = responses.filter(|_| chosen.written) {
            let points = &chosen.points;
            let new = predictions::simulated_from_posterior(study, predictor, responses, points);
            let measured: Vec<f64> = p.data.values().collect();
            self.below = probabilities_below(&measured, &new, &densities, chosen.efficiency);
        }
        let curves = Curves::of(p.data);
        self.left_out = Some(LeaveOneOut::of(&densities, chosen.efficiency, curves.of));
        Ok(true)
    }

    /// Adds the predictions of a sample of many data; false if the discrepancy has none.
    fn of_sample(
        &mut self,
        study: &Study,
        p: &Predicting<'_>,
        chosen: &Chosen,
        responses: Option<&[Vec<f64>]>,
        pieces: &mut Pieces<'_>,
    ) -> Result<bool, Stop> {
        self.left_out = sampled::left_out(study, p, chosen, responses, pieces)?;
        let (data, size) = (p.data.count(), sampled::SIZE);
        if self.left_out.is_some() {
            self.missing.push(format!(
                "leave-one-out predictions of {data} data are estimated from {size} of them and are too many to be written \
                 to `posterior.nc`"
            ));
        }
        Ok(self.left_out.is_some())
    }
}

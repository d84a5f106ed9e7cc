//! Stage 6: comparison of the calibrated model with the data, and of the emulator with the model.

mod band;
mod findings;

use std::path::Path;

use lacuna::data::measurements::Summary;
use lacuna::data::{Draws, Observations};
use lacuna::math::moments;
use lacuna::math::random::Stream;
use lacuna::plugin::model::EvalError;
use lacuna::plugin::{Emulator, Forward, Likelihood};
use lacuna::run::{Observer, Progress, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

pub use self::findings::{ValidationCase, ValidationFindings};
use super::calibrate::{Calibrated, Parts};
use super::read::Measured;
use super::screen::Z975;
use super::simulator::Simulator;
use super::{predict, stream};
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;
use crate::study::file::Against;
use crate::study::unknowns::Unknown;

/// Results of the validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Validated {
    /// Cases that were compared; see [`ValidationFindings`].
    pub cases: Vec<ValidationCase>,
    /// 95 % band of a new replicate, as lower and upper ends.
    pub predictive: Option<(Vec<f64>, Vec<f64>)>,
    /// Standard deviation of a new replicate by origin.
    pub spread: Vec<(String, f64)>,
    /// Root mean square error of the emulator at posterior draws where the model was run, and their number.
    pub emulator_at_posterior: Option<(f64, usize)>,
    /// Failed evaluations, as text.
    pub failed: Vec<String>,
}

impl Artifact for Validated {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join("validation.json"), self)?;
        Ok(vec!["validation.json".to_owned()])
    }
    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join("validation.json"))
    }
}

/// Compares the calibrated model with the data; `None` without a calibration.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Validated>>, Stop> {
    let (Some(calibrated), Some(measured)) = (calibrated, &problem.data.value.measured) else {
        return Ok(None);
    };
    let inputs = json!([
        problem.data.hash,
        problem.origin(),
        calibrated.hash,
        study.validate,
        study.model.as_ref().map(|m| (m.built.identity(), &m.common)),
        study.parameters.iter().map(|p| p.reference).collect::<Vec<_>>(),
    ]);
    let simulator = Simulator::of(study)?;
    let rerun = study.validate.rerun_model.unwrap_or(simulator.is_some());
    let simulator = simulator.filter(|_| rerun || study.validate.emulator_check > 0);
    let cases = 1 + u64::from(study.validate.against.is_some());
    observer.begin(Stage::Validate.label(), "run", cases + study.validate.emulator_check as u64);
    let kept = run.keep(&Stage::Validate.folder(), &inputs, observer, |_| {
        let parts = Parts::predicting(study, measured, problem)?;
        let work = Work {
            study,
            measured,
            forward: problem.forward(),
            emulator: problem.emulator(),
            simulator,
            rerun,
            progress: Progress::new(observer),
        };
        work.validate(&calibrated.value, parts.likelihood())
    })?;
    for failure in &kept.value.failed {
        observer.warn(failure);
    }
    observer.end(Stage::Validate.label(), &summary(&kept.value));
    Ok(Some(kept))
}

fn summary(validated: &Validated) -> String {
    // A single replicate gives no interval.
    if validated.cases.iter().all(|case| case.accuracy.is_empty()) {
        let rmse = validated.cases.iter().map(|c| format!("{} {:.3e}", c.name, c.rmse));
        return format!("rms difference: {}", rmse.collect::<Vec<_>>().join(", "));
    }
    let accuracy = validated.cases.iter().map(|c| format!("{} {:.1} %", c.name, 100.0 * c.average));
    format!("accuracy: {}", accuracy.collect::<Vec<_>>().join(", "))
}

/// Posterior predictive distribution of a new replicate.
#[derive(Default)]
struct Prediction {
    /// Ends of its 95 % band.
    band: Option<(Vec<f64>, Vec<f64>)>,
    /// Standard deviation by origin.
    spread: Vec<(String, f64)>,
}

/// Response of the model to a point, or why there is none.
type Simulated = Result<Vec<f64>, EvalError>;

struct Work<'a> {
    study: &'a Study,
    measured: &'a Measured,
    forward: &'a dyn Forward,
    /// The emulator of the model as it was run.
    emulator: Option<&'a dyn Emulator>,
    simulator: Option<Simulator<'a>>,
    rerun: bool,
    progress: Progress<'a>,
}

impl Work<'_> {
    fn validate(
        &self,
        calibrated: &Calibrated,
        likelihood: &dyn Likelihood,
    ) -> Result<Validated, Stop> {
        let mut failed = Vec::new();
        let map = &calibrated.outcome.map;
        let d = self.study.parameters.len();
        let reference = self.reference();
        let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
        let checked = self.checked(&draws);
        let rerun = self.rerun && self.simulator.is_some();
        let cases = [Some(&map[..d]), reference.as_deref()].into_iter().flatten();
        let again = cases.filter(|_| rerun);
        let mut simulated =
            self.simulated(again.chain(checked.iter().map(Vec::as_slice)).collect());
        let effects = self.study.placed_effects();
        let with_effects = |response| predict::with_effects(&effects, response, map.split_at(d));
        let mut next = || if rerun { simulated.next() } else { None };
        let mut cases = vec![self.case("map", &map[..d], next(), &with_effects, &mut failed)?];
        if let Some(point) = &reference {
            // Reference values are those of the model alone.
            cases.push(self.case("reference", point, next(), &|response| response, &mut failed)?);
        }
        let random = stream(self.study, "validate");
        let emulator_at_posterior = self.check_emulator(&checked, simulated, &mut failed)?;
        let Prediction { band, spread } = self.predict(calibrated, &draws, likelihood, &random);
        Ok(Validated { cases, predictive: band, spread, emulator_at_posterior, failed })
    }

    /// The reference of the parameters, if the study compares with it.
    fn reference(&self) -> Option<Vec<f64>> {
        // The reference of a field is its mean or median.
        let of_fields = |unknown: &Unknown| unknown.of_field().then_some(0.0);
        let both = self.study.parameters.iter().zip(&self.study.unknowns);
        let values = both.filter_map(|(p, unknown)| p.reference.or_else(|| of_fields(unknown)));
        (self.study.validate.against == Some(Against::Reference)).then(|| values.collect())
    }

    /// Evenly spaced posterior draws at which the emulator is compared with new runs of the model.
    fn checked(&self, draws: &Draws) -> Vec<Vec<f64>> {
        let count = self.study.validate.emulator_check.min(draws.len());
        if count == 0 || self.simulator.is_none() {
            return Vec::new();
        }
        let d = self.study.parameters.len();
        let points = draws.points();
        let place = |k: usize| (2 * k + 1) * draws.len() / (2 * count);
        (0..count).map(|k| points.row(place(k))[..d].to_vec()).collect()
    }

    /// Responses of the model to some parameters, in their order.
    fn simulated(&self, points: Vec<&[f64]>) -> std::vec::IntoIter<Simulated> {
        let Some(simulator) = &self.simulator else { return Vec::new().into_iter() };
        let respond = |point: &&[f64]| {
            let response = simulator.respond(point).map(|response| response.values);
            self.progress.add(1);
            response
        };
        points.par_iter().map(respond).collect::<Vec<_>>().into_iter()
    }

    /// Compares a point with the data: the response of the model there, or without one that of the emulator.
    fn case(
        &self,
        name: &str,
        point: &[f64],
        simulated: Option<Simulated>,
        with_effects: &dyn Fn(Vec<f64>) -> Vec<f64>,
        failed: &mut Vec<String>,
    ) -> Result<ValidationCase, Stop> {
        let simulated = match simulated {
            Some(Ok(values)) => Some(self.with_numerics(values, point)),
            Some(Err(EvalError::Rejected(reason))) => {
                failed.push(format!(
                    "the evaluation of the model at the {name} parameters failed: {reason}"
                ));
                None
            }
            Some(Err(EvalError::Fatal(reason))) => return Err(Stop::new(reason)),
            None => {
                self.progress.add(1);
                None
            }
        };
        let row = Matrix::from_vec(1, point.len(), point.to_vec());
        let is_simulated = simulated.is_some();
        let response = simulated.unwrap_or_else(|| self.forward.mean(&row).row(0).to_vec());
        let response = with_effects(response);
        let accuracy = accuracy(&self.measured.used, &response);
        let shares: Vec<f64> = accuracy.iter().map(|a| a.1).collect();
        let average = if shares.is_empty() { 0.0 } else { moments::mean(&shares) };
        Ok(ValidationCase {
            name: name.to_owned(),
            point: point.to_vec(),
            rmse: rmse(&self.measured.used, &response),
            response,
            simulated: is_simulated,
            accuracy,
            average,
        })
    }

    /// Adds the predicted numerical error to a response of the model.
    fn with_numerics(&self, mut response: Vec<f64>, point: &[f64]) -> Vec<f64> {
        let row = Matrix::from_vec(1, point.len(), point.to_vec());
        if let Some(emulator) = self.emulator {
            let (with, without) = (self.forward.mean(&row), emulator.mean(&row));
            let differences = with.row(0).iter().zip(without.row(0)).map(|(a, b)| a - b);
            response.iter_mut().zip(differences).for_each(|(y, difference)| *y += difference);
        }
        response
    }

    /// Compares the emulator with new runs of the model at these parameters.
    fn check_emulator(
        &self,
        points: &[Vec<f64>],
        simulated: impl Iterator<Item = Simulated>,
        failed: &mut Vec<String>,
    ) -> Result<Option<(f64, usize)>, Stop> {
        let (mut squares, mut checked) = (0.0, 0);
        for (point, simulated) in points.iter().zip(simulated) {
            match simulated {
                Ok(response) => {
                    let row = Matrix::from_vec(1, point.len(), point.clone());
                    let emulated = match self.emulator {
                        Some(emulator) => emulator.mean(&row),
                        None => self.forward.mean(&row),
                    };
                    let pairs = response.iter().zip(emulated.row(0));
                    squares += pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                    checked += 1;
                }
                Err(EvalError::Rejected(reason)) => {
                    failed.push(format!(
                        "the evaluation of the model at a posterior draw failed: {reason}"
                    ));
                }
                Err(EvalError::Fatal(reason)) => return Err(Stop::new(reason)),
            }
        }
        let outputs = self.study.layouts.len() as f64;
        Ok((checked > 0)
            .then(|| ((squares / (f64::from(checked) * outputs)).sqrt(), checked as usize)))
    }

    /// 95 % band of a new replicate from data simulated at posterior draws, and its standard deviation by origin.
    fn predict(
        &self,
        calibrated: &Calibrated,
        draws: &Draws,
        likelihood: &dyn Likelihood,
        random: &Stream,
    ) -> Prediction {
        let own = likelihood.hyperparameters().len();
        if draws.is_empty() {
            return Prediction::default();
        }
        let map = &calibrated.outcome.map;
        let at_map = &predict::responses(
            self.study,
            self.forward,
            &Matrix::from_vec(1, map.len(), map.clone()),
        )[0];
        let parts = likelihood.predictive(at_map, &map[map.len() - own..]);
        let mut spread: Vec<(String, f64)> = parts
            .iter()
            .map(|part| (part.origin.to_string(), moments::mean(&part.variance).sqrt()))
            .collect();
        let sds: Vec<f64> = self
            .measured
            .used
            .summaries()
            .iter()
            .filter_map(|s| s.sd().map(|sd| sd * sd))
            .collect();
        if !sds.is_empty() {
            spread.push(("replicates".to_owned(), moments::mean(&sds).sqrt()));
        }
        Prediction { band: Some(self.band(draws, likelihood, random)), spread }
    }
}

/// Fraction of points inside the replicates' 95 % interval `mean +- 1.96 sd`, for each group (Radaideh et al., arXiv
/// 2202.03959). Points with fewer than two replicates are not counted.
pub fn accuracy(data: &Observations, response: &[f64]) -> Vec<(String, f64)> {
    let summaries = data.summaries();
    let share = |indices: &[usize]| {
        let (mut inside, mut judged) = (0.0, 0.0);
        for &i in indices {
            if let Some(sd) = summaries[i].sd() {
                judged += 1.0;
                inside += f64::from(u8::from((response[i] - summaries[i].mean).abs() <= Z975 * sd));
            }
        }
        (judged > 0.0).then(|| inside / judged)
    };
    let groups = data.layouts().groups();
    groups.iter().filter_map(|g| Some((g.name.clone(), share(&g.indices)?))).collect()
}

/// Root mean square difference between a response and the replicates' mean.
fn rmse(data: &Observations, response: &[f64]) -> f64 {
    let summaries = data.summaries();
    let measured = summaries.iter().zip(response).filter(|(s, _)| s.count > 0);
    let squares: Vec<f64> = measured.map(|(s, y)| (y - s.mean).powi(2)).collect();
    moments::mean(&squares).sqrt()
}

impl Validated {
    /// Residuals of the first case, as [`ValidationFindings::residuals`] has them; empty without a case or a band.
    fn residuals(&self, replicates: &[Summary]) -> Vec<f64> {
        let (Some(case), Some((low, high))) = (self.cases.first(), &self.predictive) else {
            return Vec::new();
        };
        let one = |(i, summary): (usize, &Summary)| {
            let sd = (high[i] - low[i]) / (2.0 * Z975);
            let is_known = summary.count > 0 && sd > 0.0;
            if is_known { (summary.mean - case.response[i]) / sd } else { f64::NAN }
        };
        replicates.iter().enumerate().map(one).collect()
    }

    /// Findings for the report.
    pub fn findings(&self, measured: &Measured) -> ValidationFindings {
        let replicates = measured.used.summaries();
        ValidationFindings {
            cases: self.cases.clone(),
            replicates: replicates
                .iter()
                .map(|s| (s.count, s.mean, s.sd().unwrap_or(0.0)))
                .collect(),
            residuals: self.residuals(&replicates),
            predictive: self.predictive.clone(),
            spread: self.spread.clone(),
        }
    }
}

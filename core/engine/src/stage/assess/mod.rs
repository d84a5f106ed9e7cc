//! Stage 6: verdict on whether the result can be trusted. Numbers of all other stages give findings, and findings the
//! verdict.
//!
//! The thresholds of the findings and their reasons are in [`crate::assess`]; this module collects the numbers.

mod data;
mod errors;
mod fit;
mod intervals;
mod posterior;
mod runs;
mod series;

use std::path::Path;

use lacuna::plugin::Likelihood;
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use serde_json::json;

use super::artifacts::Artifacts;
use super::calibrate::{Calibrated, Parts};
use super::predict;
use super::read::Measured;
use crate::assess::{Assessment, Finding, conditions, influence};
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

const FILE: &str = "assessment.json";

impl Artifact for Assessment {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(FILE))
    }
}

/// Noise of a single value of each output as the study states it; empty if it states none.
fn stated_noise(study: &Study) -> Vec<Option<f64>> {
    let noise = study.measurements.as_ref().and_then(|section| section.common.noise.as_ref());
    let outputs = noise.into_iter().flat_map(|noise| {
        study.layouts.blocks.iter().flat_map(|block| noise.of(block)).collect::<Vec<_>>()
    });
    outputs.map(|output| output.sd).collect()
}

/// Judges the results of the other stages.
pub fn stage(
    study: &Study,
    all: &Artifacts<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Assessment>, Stop> {
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.design, &p.prior)).collect();
    let laws = study.prior_identity(json!(laws));
    let effects = study.effects_identity();
    let problem = all.problem.map(|problem| {
        let refined = problem.refinement().map(|r| (r.rounds, r.ratio, r.clear, r.reached));
        json!([
            problem.data.hash,
            problem.origin(),
            problem.numerics().map(|n| &n.hash),
            problem.region(),
            refined,
            problem.fitted().map(|f| &f.hash)
        ])
    });
    let inputs = json!([
        problem,
        all.calibrated.map(|c| &c.hash),
        all.weighed.map(|w| &w.hash),
        all.validated.map(|v| &v.hash),
        study.surrogate.as_ref().map(|s| &s.common),
        study.measurements.as_ref().map(|m| &m.common),
        study.discrepancy.as_ref().map(|d| (d.built.identity(), &d.common)),
        effects,
        laws,
        study.about.seed
    ]);
    // Quantities matter to the checks only where they are predicted under conditions that were not measured, or bounded.
    let bounded = !study.intervals().is_empty();
    let examined =
        all.quantities.filter(|_| bounded || study.scenarios.iter().any(|s| s.unmeasured));
    let inputs = match examined {
        Some(quantities) => json!([inputs, quantities.hash]),
        None => inputs,
    };
    observer.begin(Stage::Assess.label(), "check", 0);
    let kept = run.keep(&Stage::Assess.folder(), &inputs, observer, |_| assess(study, all))?;
    observer.end(Stage::Assess.label(), &kept.value.line());
    Ok(kept)
}

fn assess(study: &Study, all: &Artifacts<'_>) -> Result<Assessment, Stop> {
    let mut findings = Vec::new();
    let calibrated = all.calibrated.map(|kept| &kept.value);
    if let Some(problem) = all.problem {
        let errors = match (calibrated, &problem.data.value.measured) {
            // One response of a stochastic model cannot be compared with the data.
            (Some(calibrated), Some(measured)) if !study.is_stochastic() => {
                let parts = Parts::of(study, measured, problem)?;
                let predictive = Parts::predicting(study, measured, problem)?;
                let likelihoods = [parts.likelihood(), predictive.likelihood()];
                let judged = Judged::of(study, problem, calibrated, measured, likelihoods);
                findings.extend(fit::findings(&judged, all));
                let errors = errors::of(&judged, all);
                findings.extend(errors.findings.iter().cloned());
                errors
            }
            _ => errors::Errors::default(),
        };
        findings.extend(errors::of_emulator(problem));
        findings.extend(runs::findings(study, problem, calibrated, errors.shift)?);
        if let Some(measured) = &problem.data.value.measured {
            findings.extend(data::findings(study, problem, measured));
        }
    }
    if study.measurements.is_some() && all.quantities.is_some() {
        let unmeasured = study.scenarios.iter().filter(|scenario| scenario.unmeasured);
        findings.extend(unmeasured.filter_map(|s| conditions::beyond(s, &study.scenarios)));
    }
    findings.extend(all.quantities.iter().flat_map(|kept| intervals::findings(&kept.value)));
    if let Some(left) = all.weighed.and_then(|kept| kept.value.left_out.as_ref()) {
        findings.extend(influence::influential(left.unreliable, left.data.len()));
    }
    if let Some(calibrated) = calibrated {
        let region = all.problem.and_then(InverseProblem::region);
        findings.extend(posterior::findings(study, calibrated, region));
    }
    Ok(Assessment::of(findings))
}

/// A calibration with its data, for checks that compare both.
struct Judged<'a> {
    study: &'a Study,
    problem: &'a InverseProblem<'a>,
    calibrated: &'a Calibrated,
    measured: &'a Measured,
    likelihood: &'a dyn Likelihood,
    /// Likelihood that simulates new data.
    predictive: &'a dyn Likelihood,
    /// Response at the MAP, including effects.
    response: Vec<f64>,
}

impl<'a> Judged<'a> {
    fn of(
        study: &'a Study,
        problem: &'a InverseProblem<'a>,
        calibrated: &'a Calibrated,
        measured: &'a Measured,
        [likelihood, predictive]: [&'a dyn Likelihood; 2],
    ) -> Self {
        let response = Vec::new();
        let mut judged =
            Self { study, problem, calibrated, measured, likelihood, predictive, response };
        let map = calibrated.outcome.map.clone();
        judged.response = judged.responses(&Matrix::from_vec(1, map.len(), map)).remove(0);
        judged
    }

    fn responses(&self, points: &Matrix) -> Vec<Vec<f64>> {
        predict::responses(self.study, self.problem.forward(), points)
    }

    /// The hyperparameters of the discrepancy, which are the last coordinates of a point.
    fn hyper<'p>(&self, point: &'p [f64]) -> &'p [f64] {
        &point[point.len() - self.likelihood.hyperparameters().len()..]
    }

    /// Variance of a new replicate at the MAP, one value per output.
    fn variance(&self) -> Vec<f64> {
        let parts =
            self.predictive.predictive(&self.response, self.hyper(&self.calibrated.outcome.map));
        let sum = |j: usize| parts.iter().filter_map(|part| part.variance.get(j)).sum();
        (0..self.response.len()).map(sum).collect()
    }
}

/// Collects the findings that are present.
fn some(findings: impl IntoIterator<Item = Option<Finding>>) -> Vec<Finding> {
    findings.into_iter().flatten().collect()
}

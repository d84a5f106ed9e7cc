//! Stage 6: whether the result can be trusted. Numbers of all other stages become findings, findings a verdict.
//!
//! What is a finding, from which figure on and why, is decided in [`crate::assess`]; here the figures are gathered.

mod data;
mod errors;
mod fit;
mod posterior;
mod runs;

use std::path::Path;

use serde_json::json;

use crate::assess::{Assessment, Finding, influence};
use crate::linalg::Matrix;
use crate::plugin::Likelihood;
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop, files};
use crate::study::Study;

use super::calibrate::{Calibrated, Parts};
use super::read::Measured;
use super::report::Artifacts;
use super::{Known, predict};

const FILE: &str = "assessment.json";
const FOLDER: &str = "6-assess";

impl Artifact for Assessment {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(FILE))
    }
}

/// Judges what the other stages found.
pub fn stage(
    study: &Study,
    all: &Artifacts<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Assessment>, Stop> {
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.design, &p.prior)).collect();
    let effects: Vec<_> = study.effects.iter().map(|e| (e.built.identity(), &e.common)).collect();
    let known = all.known.map(|known| {
        let refined = known.refinement.map(|r| (r.rounds, r.ratio, r.clear, r.reached));
        json!([
            known.data.hash,
            known.origin,
            known.numerics.map(|n| &n.hash),
            known.region,
            refined,
            known.fitted.map(|f| &f.hash)
        ])
    });
    let inputs = json!([
        known,
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
    observer.begin("assess", "check", 0);
    let kept = run.keep(FOLDER, &inputs, observer, |_| assess(study, all))?;
    observer.end("assess", &kept.value.line());
    Ok(kept)
}

fn assess(study: &Study, all: &Artifacts<'_>) -> Result<Assessment, Stop> {
    let mut findings = Vec::new();
    let calibrated = all.calibrated.map(|kept| &kept.value);
    if let Some(known) = all.known {
        let errors = match (calibrated, &known.data.value.measured) {
            (Some(calibrated), Some(measured)) => {
                let parts = Parts::of(study, measured, known)?;
                let predictive = Parts::predicting(study, measured, known)?;
                let likelihoods = [parts.likelihood(), predictive.likelihood()];
                let judged = Judged::of(study, known, calibrated, measured, likelihoods);
                findings.extend(fit::findings(&judged, all));
                let errors = errors::of(&judged, all);
                findings.extend(errors.findings.iter().cloned());
                errors
            }
            _ => errors::Errors::default(),
        };
        findings.extend(errors::of_emulator(known));
        findings.extend(runs::findings(study, known, calibrated, errors.shift)?);
        if let Some(measured) = &known.data.value.measured {
            findings.extend(data::findings(study, known, measured));
        }
    }
    if let Some(left) = all.weighed.and_then(|kept| kept.value.left_out.as_ref()) {
        findings.extend(influence::influential(left.unreliable, left.data.len()));
    }
    if let Some(calibrated) = calibrated {
        let region = all.known.and_then(|known| known.region);
        findings.extend(posterior::findings(study, calibrated, region));
    }
    Ok(Assessment::of(findings))
}

/// A calibration with its data, for those who compare both.
struct Judged<'a> {
    study: &'a Study,
    known: &'a Known<'a>,
    calibrated: &'a Calibrated,
    measured: &'a Measured,
    likelihood: &'a dyn Likelihood,
    /// What makes new data.
    predictive: &'a dyn Likelihood,
    /// The response at the MAP, effects included.
    response: Vec<f64>,
}

impl<'a> Judged<'a> {
    fn of(
        study: &'a Study,
        known: &'a Known<'a>,
        calibrated: &'a Calibrated,
        measured: &'a Measured,
        [likelihood, predictive]: [&'a dyn Likelihood; 2],
    ) -> Self {
        let response = Vec::new();
        let mut judged =
            Self { study, known, calibrated, measured, likelihood, predictive, response };
        let map = calibrated.outcome.map.clone();
        judged.response = judged.responses(&Matrix::from_vec(1, map.len(), map)).remove(0);
        judged
    }

    fn responses(&self, points: &Matrix) -> Vec<Vec<f64>> {
        predict::responses(self.study, self.known.forward, points)
    }

    /// The discrepancy's own unknowns, the last coordinates of a point.
    fn hyper<'p>(&self, point: &'p [f64]) -> &'p [f64] {
        &point[point.len() - self.likelihood.hyperparameters().len()..]
    }

    /// The variance of a new replicate at the MAP, one an output.
    fn variance(&self) -> Vec<f64> {
        let parts =
            self.predictive.predictive(&self.response, self.hyper(&self.calibrated.outcome.map));
        let sum = |j: usize| parts.iter().filter_map(|part| part.variance.get(j)).sum();
        (0..self.response.len()).map(sum).collect()
    }
}

/// Keeps the findings that there are.
fn some(findings: impl IntoIterator<Item = Option<Finding>>) -> Vec<Finding> {
    findings.into_iter().flatten().collect()
}

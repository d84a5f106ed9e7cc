//! Stage 6: how probable the data are under the study, and how well each datum is predicted from the others.
//!
//! What [`compare`](crate::compare) puts side by side for several studies of the same data.

use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::data::Draws;
use crate::diagnose::bridge;
use crate::diagnose::leave_one_out::{LeaveOneOut, Left};
use crate::linalg::Matrix;
use crate::plugin::sampler::Evidence;
use crate::plugin::{Forward, Likelihood};
use crate::posterior::Posterior;
use crate::report::number::significant;
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop, files};
use crate::study::Study;

use super::calibrate::Calibrated;
use super::{predict, stream};

/// What speaks for a study as a whole.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Weighed {
    /// The probability of the data, where it could be had.
    pub evidence: Option<Evidence>,
    /// The prediction of each datum from all others, where the discrepancy knows it.
    pub left_out: Option<LeaveOneOut>,
    /// Why something is missing, or less than it could be.
    pub missing: Vec<String>,
}

/// The part of it that is no array.
#[derive(Serialize, Deserialize)]
struct Header {
    evidence: Option<Evidence>,
    left_out: bool,
    missing: Vec<String>,
}

impl Artifact for Weighed {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let header = Header {
            evidence: self.evidence.clone(),
            left_out: self.left_out.is_some(),
            missing: self.missing.clone(),
        };
        files::write_json(&folder.join("evidence.json"), &header)?;
        let mut names = vec!["evidence.json".to_owned()];
        if let Some(loo) = &self.left_out {
            let column = |name: &str, value: fn(&Left) -> f64| Array {
                name: name.to_owned(),
                dimensions: vec![("datum".to_owned(), loo.data.len())],
                values: loo.data.iter().map(value).collect(),
                unit: None,
            };
            let columns = [
                column("elpd", |left| left.elpd),
                column("with_it", |left| left.with_it),
                column("k_hat", |left| left.k_hat),
            ];
            arrays::write(&folder.join(LEFT_OUT), &[], &columns)?;
            names.push(LEFT_OUT.to_owned());
        }
        Ok(names)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let header: Header = files::read_json(&folder.join("evidence.json"))?;
        let left_out = header.left_out.then(|| left_out(folder)).transpose()?;
        Ok(Self { evidence: header.evidence, left_out, missing: header.missing })
    }
}

/// The folder of the stage.
pub const FOLDER: &str = "6-evidence";
const LEFT_OUT: &str = "left_out.nc";

/// The predictions that a run kept in the stage's folder.
pub fn left_out(folder: &Path) -> Result<LeaveOneOut, Stop> {
    let path = folder.join(LEFT_OUT);
    let column = |name: &str| arrays::read(&path, name).map(|array| array.values);
    let (elpd, with_it, k_hat) = (column("elpd")?, column("with_it")?, column("k_hat")?);
    let each = elpd.into_iter().zip(with_it).zip(k_hat);
    Ok(LeaveOneOut::sum(
        each.map(|((elpd, with_it), k_hat)| Left { elpd, with_it, k_hat }).collect(),
    ))
}

/// What predicts the data, where there are any.
#[derive(Clone, Copy)]
pub struct Predicting<'a> {
    /// From parameters to responses.
    pub forward: &'a dyn Forward,
    /// The likelihood.
    pub likelihood: &'a dyn Likelihood,
    /// The number of data in it.
    pub data: usize,
}

/// Weighs a calibrated study.
pub fn stage(
    study: &Study,
    posterior: &Posterior<'_>,
    calibrated: &Kept<Calibrated>,
    predicting: Option<Predicting<'_>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Weighed>, Stop> {
    observer.begin("evidence", "draw", 0);
    let kept = run.keep(FOLDER, &json!([calibrated.hash, study.about.seed]), observer, |_| {
        let draws = calibrated.value.draws.from_step(calibrated.value.outcome.burn_in);
        let mut missing = Vec::new();
        let evidence = match &calibrated.value.outcome.evidence {
            Some(evidence) => Some(evidence.clone()),
            None => bridge::bridge(
                posterior,
                &coordinates(posterior, &thinned(&draws)),
                &stream(study, "evidence"),
            )
            .map_err(|reason| missing.push(format!("no evidence: {reason}")))
            .ok(),
        };
        let left_out = predicting.and_then(|p| predictions(study, p, &draws, &mut missing));
        Ok(Weighed { evidence, left_out, missing })
    })?;
    observer.end("evidence", &summary(&kept.value));
    Ok(kept)
}

fn summary(weighed: &Weighed) -> String {
    let evidence = weighed.evidence.as_ref();
    let mut parts: Vec<String> = evidence
        .map(|e| format!("log evidence {:.2} ± {}", e.log, significant(e.error, 2)))
        .into_iter()
        .collect();
    let loo = weighed.left_out.as_ref();
    parts.extend(loo.map(|l| format!("log predictive density {:.1} ± {:.1}", l.elpd, l.error)));
    parts.extend(weighed.missing.iter().cloned());
    parts.join(", ")
}

/// About how many draws the evidence is estimated from.
const WEIGHED: usize = 20_000;

/// Some of the chains, at least four, and of long chains the last steps.
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

/// The number of draws behind the predictions of left-out data.
const PREDICTED: usize = 400;

/// How many draws are looked at together.
const TOGETHER: usize = 40;

fn predictions(
    study: &Study,
    p: Predicting<'_>,
    draws: &Draws,
    missing: &mut Vec<String>,
) -> Option<LeaveOneOut> {
    let wanted = PREDICTED.min(draws.len());
    let count = predict::affordable(wanted, p.data);
    let chosen = draws.points().select_rows(&predict::spaced(count, draws.len()));
    let own = p.likelihood.hyperparameters().len();
    let mut all: Option<Matrix> = None;
    for first in (0..count).step_by(TOGETHER) {
        let rows: Vec<usize> = (first..count.min(first + TOGETHER)).collect();
        let some = chosen.select_rows(&rows);
        let responses = predict::responses(study, p.forward, &some);
        let left_out = |(i, response): (usize, &Vec<f64>)| {
            p.likelihood.left_out(response, &some.row(i)[some.columns() - own..])
        };
        let densities: Option<Vec<_>> = responses.par_iter().enumerate().map(left_out).collect();
        for (row, density) in rows.iter().zip(densities?) {
            let all = all.get_or_insert_with(|| Matrix::zeros(count, density.len()));
            all.row_mut(*row).copy_from_slice(&density);
        }
    }
    if all.is_some() && count < wanted {
        missing.push(format!(
            "each of {} data is predicted from {count} draws, not from {wanted}: more would not fit into memory",
            p.data
        ));
    }
    all.as_ref().map(LeaveOneOut::of)
}

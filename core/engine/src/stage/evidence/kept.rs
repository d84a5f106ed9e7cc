//! Files of the evidence stage: `evidence.json`, and `left_out.nc` with one value per datum or curve.

use std::path::Path;

use lacuna::diagnose::leave_one_out::{LeaveOneOut, Left, Sampled};
use lacuna::diagnose::pareto::LARGEST_K;
use lacuna::plugin::sampler::Evidence;
use lacuna::run::{Stop, files};
use lacuna_run::Artifact;
use lacuna_run::arrays::{self, Array};
use serde::{Deserialize, Serialize};

use super::Weighed;

/// Part of the result that is not an array.
#[derive(Serialize, Deserialize)]
struct Header {
    evidence: Option<Evidence>,
    left_out: bool,
    curves_left_out: bool,
    missing: Vec<String>,
}

const LEFT_OUT: &str = "left_out.nc";

/// Prefix of the names of the arrays by datum.
const DATUM: &str = "";
const CURVE: &str = "curve_";

/// Array of the sums over all data if the data by datum are a sample: number of data, standard error by the sampling, `elpd`,
/// its two standard errors (NaN without curves), and `p_loo`.
const WHOLE: &str = "whole";

/// Array of the probabilities of values below the measured ones.
const BELOW: &str = "below";

impl Artifact for Weighed {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let header = Header {
            evidence: self.evidence.clone(),
            left_out: self.left_out.is_some(),
            curves_left_out: self.curves_left_out.is_some(),
            missing: self.missing.clone(),
        };
        files::write_json(&folder.join("evidence.json"), &header)?;
        let mut names = vec!["evidence.json".to_owned()];
        let mut all = Vec::new();
        if let Some(loo) = &self.left_out {
            all.extend(columns(loo, DATUM, "datum"));
        }
        if !self.below.is_empty() {
            all.push(by("datum", BELOW, self.below.clone()));
        }
        if let Some(loo) = &self.curves_left_out {
            all.extend(columns(loo, CURVE, "curve"));
        }
        if let Some(densities) = &self.by_curve {
            all.push(Array::matrix("by_curve", "draw", "curve", densities));
        }
        if !all.is_empty() {
            arrays::write(&folder.join(LEFT_OUT), &[], &all)?;
            names.push(LEFT_OUT.to_owned());
        }
        Ok(names)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let header: Header = files::read_json(&folder.join("evidence.json"))?;
        let path = folder.join(LEFT_OUT);
        let by_curve = header.curves_left_out.then(|| arrays::read(&path, "by_curve"));
        Ok(Self {
            evidence: header.evidence,
            left_out: header.left_out.then(|| left_out(folder)).transpose()?,
            curves_left_out: header.curves_left_out.then(|| read(&path, CURVE)).transpose()?,
            // Studies whose simulated data are too many have none.
            below: arrays::read(&path, BELOW).map(Array::into_values).unwrap_or_default(),
            by_curve: by_curve.transpose()?.map(Array::into_matrix),
            missing: header.missing,
        })
    }
}

/// Arrays with one value per datum or curve; includes the curve of each datum if it is known.
fn columns(loo: &LeaveOneOut, prefix: &str, dimension: &str) -> Vec<Array<'static>> {
    let array =
        |name: &str, dimension: &str, values| by(dimension, &format!("{prefix}{name}"), values);
    let column = |name, value: fn(&Left) -> f64| {
        array(name, dimension, loo.data.iter().map(value).collect())
    };
    let mut columns = vec![
        column("elpd", |left| left.elpd),
        column("with_it", |left| left.with_it),
        column("k_hat", |left| left.k_hat),
        array("limit", "one", vec![loo.limit]),
    ];
    if let Some(Sampled { of, error }) = loo.sampled {
        let by_curve = loo.error_by_curve.unwrap_or(f64::NAN);
        let sums = vec![of as f64, error, loo.elpd, loo.error, by_curve, loo.parameters];
        columns.push(array(WHOLE, "sum", sums));
    }
    if !loo.curve.is_empty() {
        columns.push(array("curve", dimension, loo.curve.iter().map(|&c| c as f64).collect()));
    }
    columns
}

/// An array with one value for each element of a dimension.
fn by(dimension: &str, name: &str, values: Vec<f64>) -> Array<'static> {
    Array {
        name: name.to_owned(),
        dimensions: vec![(dimension.to_owned(), values.len())],
        values: values.into(),
        unit: None,
    }
}

fn read(path: &Path, prefix: &str) -> Result<LeaveOneOut, Stop> {
    let column =
        |name: &str| arrays::read(path, &format!("{prefix}{name}")).map(Array::into_values);
    let (elpd, with_it, k_hat) = (column("elpd")?, column("with_it")?, column("k_hat")?);
    let each = elpd.into_iter().zip(with_it).zip(k_hat);
    // Runs of earlier versions have neither limit nor curves.
    let limit = column("limit").ok().and_then(|limit| limit.first().copied());
    let curve = column("curve").unwrap_or_default();
    let whole = column(WHOLE).unwrap_or_default();
    let own = LeaveOneOut::sum(
        each.map(|((elpd, with_it), k_hat)| Left { elpd, with_it, k_hat }).collect(),
        limit.unwrap_or(LARGEST_K),
        curve.into_iter().map(|c| c as usize).collect(),
    );
    let &[of, by_sampling, elpd, error, by_curve, parameters] = &whole[..] else { return Ok(own) };
    let sampled = Some(Sampled { of: of as usize, error: by_sampling });
    let error_by_curve = Some(by_curve).filter(|error| !error.is_nan());
    Ok(LeaveOneOut { elpd, error, error_by_curve, parameters, sampled, ..own })
}

/// Reads the leave-one-out predictions of data that a run kept in the stage's folder.
pub fn left_out(folder: &Path) -> Result<LeaveOneOut, Stop> {
    read(&folder.join(LEFT_OUT), DATUM)
}

/// Reads the leave-one-out predictions of curves; `None` if the run has none.
pub fn curves_left_out(folder: &Path) -> Option<LeaveOneOut> {
    read(&folder.join(LEFT_OUT), CURVE).ok()
}

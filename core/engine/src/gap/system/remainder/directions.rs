//! The directions of a remainder: waves along the curves, correlated between sensors; or known forms.

use std::f64::consts::{PI, TAU};

use lacuna_linalg::{Matrix, symmetric_eigen};

use crate::gap::experiment::{Experiment, MeasuredCurve};

/// The share of the correlation between sensors that the responses to the parameters give.
const TOGETHER: f64 = 0.9;

/// The shortest length, in steps of a curve.
const SHORTEST: f64 = 2.0;

/// The smallest interval of the basis over that of a curve, and over a length; and the number of basis functions for an
/// interval of one length (G. Riutort-Mayol, P.-C. Bürkner, M. Andersen, A. Solin and A. Vehtari, Statistics and Computing
/// 33 (2023) 17, equations 12 and 13).
const WIDER: f64 = 1.2;
const WIDER_THAN_LENGTH: f64 = 3.2;
const WAVES: f64 = 1.75;

/// The directions of the [forms](Experiment::forms) of an experiment, together of variance one in units of the noise of the
/// mean, each with its variance.
pub(super) fn of_forms(experiment: &Experiment<'_>, scale: &[f64]) -> Vec<(f64, Vec<f64>)> {
    let mut sd = vec![0.0; experiment.outputs()];
    for (curve, scale) in experiment.curves.iter().zip(scale) {
        curve.measured.iter().for_each(|&i| sd[i] = *scale);
    }
    let count = sd.iter().filter(|sd| **sd > 0.0).count().max(1) as f64;
    let square = |row: &[f64]| {
        let pairs = row.iter().zip(&sd).filter(|(_, sd)| **sd > 0.0);
        pairs.map(|(y, sd)| (y / sd).powi(2)).sum::<f64>() / count
    };
    let all: f64 = experiment.forms.iter_rows().map(square).sum();
    let size = all.max(f64::MIN_POSITIVE).sqrt();
    let form = |row: &[f64]| -> (f64, Vec<f64>) {
        let pairs = row.iter().zip(&sd);
        let scaled = pairs.map(|(y, sd)| if *sd > 0.0 { y / size } else { 0.0 });
        (square(row) / all.max(f64::MIN_POSITIVE), scaled.collect())
    };
    experiment.forms.iter_rows().map(form).collect()
}

/// The curves of each condition that have the same places.
pub(super) fn groups(experiment: &Experiment<'_>) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (s, curve) in experiment.curves.iter().enumerate().filter(|(_, c)| !c.measured.is_empty()) {
        let same =
            |other: &MeasuredCurve| other.condition == curve.condition && other.at == curve.at;
        match groups.iter_mut().find(|group| same(&experiment.curves[group[0]])) {
            Some(group) => group.push(s),
            None => groups.push(vec![s]),
        }
    }
    groups
}

/// The directions of the curves of a group, each with its variance without the noise's scale.
pub(super) fn of_group(
    experiment: &Experiment<'_>,
    group: &[usize],
    scale: &[f64],
    slopes: &Matrix,
    share: f64,
) -> Vec<(f64, Vec<f64>)> {
    let correlation = correlation(experiment, group, slopes);
    let Ok(eigen) = symmetric_eigen(&correlation) else { return Vec::new() };
    let waves = waves(&experiment.curves[group[0]].at, share);
    let mut columns = Vec::new();
    for (a, &variance) in eigen.values.iter().enumerate().filter(|(_, v)| **v > 1e-9) {
        for (power, wave) in &waves {
            let mut column = vec![0.0; experiment.outputs()];
            for (k, &s) in group.iter().enumerate() {
                let size = scale[s] * eigen.vectors[(k, a)] * variance.sqrt() * power.sqrt();
                let measured = experiment.curves[s].measured.iter();
                measured.zip(wave).for_each(|(&i, w)| column[i] = size * w);
            }
            columns.push((variance * power, column));
        }
    }
    columns
}

/// `TOGETHER` times the correlation of the curves' changes by the unknowns, and the identity.
fn correlation(experiment: &Experiment<'_>, group: &[usize], slopes: &Matrix) -> Matrix {
    let product = |a: usize, b: usize| -> f64 {
        let (a, b) = (&experiment.curves[a].measured, &experiment.curves[b].measured);
        slopes
            .iter_rows()
            .map(|row| a.iter().zip(b).map(|(&i, &j)| row[i] * row[j]).sum::<f64>())
            .sum()
    };
    let own: Vec<f64> = group.iter().map(|&s| product(s, s)).collect();
    Matrix::from_fn(group.len(), group.len(), |a, b| {
        if a == b {
            return 1.0;
        }
        let norm = (own[a] * own[b]).sqrt();
        if norm > 0.0 { TOGETHER * product(group[a], group[b]) / norm } else { 0.0 }
    })
}

/// The basis functions of a squared exponential process of variance one over these places, with the variance of each.
fn waves(at: &[f64], share: f64) -> Vec<(f64, Vec<f64>)> {
    let (first, last) = (at[0], at[at.len() - 1]);
    let half = 0.5 * (last - first);
    if at.len() < 4 || half <= 0.0 {
        return vec![(1.0, vec![1.0; at.len()])];
    }
    // In units of half the curve. The interval is that of the stated length: a few points show no more of the process.
    let length = 2.0 * share.max(SHORTEST / at.len() as f64);
    let wider = (WIDER_THAN_LENGTH * 2.0 * share).max(WIDER);
    let count = (WAVES * wider / length).ceil() as usize + 1;
    let wave = |k: usize| {
        let frequency = PI * k as f64 / (2.0 * wider);
        let power = TAU.sqrt() * length * (-0.5 * (frequency * length).powi(2)).exp();
        let value = |t: &f64| {
            let x = (t - first) / half - 1.0;
            (frequency * (x + wider)).sin() / wider.sqrt()
        };
        (power, at.iter().map(value).collect())
    };
    (1..=count).map(wave).collect()
}

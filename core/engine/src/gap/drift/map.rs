//! The drift map: values by window, the tests of equality, and their reading.

use lacuna::math::random::Stream;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector};
use serde::{Deserialize, Serialize};

use super::equality::{Equality, WindowSlopes};
use super::pieces::{Window, windows};
use super::reading::{DriftLevel, MisfitShare, read, shares};
use super::setting::{DriftSetting, DriftingParameter, drifting};
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, precision};
use crate::gap::system::whitener::Whitener;

/// Smallest gain in log density at which the refit continues.
const GAIN: f64 = 1e-4;

/// The options of a drift map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriftOptions {
    /// The largest number of windows per condition.
    pub windows: usize,
    /// The largest number of steps of the exact refit of all windows, each with one linearisation of the model per
    /// window; if zero, the values are linearised about the joint fit.
    pub refits: usize,
    /// The number of simulations of the null distribution, with the noise estimated again in each; if zero, the noise
    /// is taken as known, which gives too small p-values with few replicates.
    pub simulations: usize,
}

impl Default for DriftOptions {
    fn default() -> Self {
        Self { windows: 4, refits: 5, simulations: 199 }
    }
}

/// The parameters in one window of the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WindowEstimate {
    /// The index of the condition in the experiment.
    pub condition: usize,
    /// The name of the scenario; `None` if the study has none.
    pub scenario: Option<String>,
    /// The first and the last place along the last axis, in its unit.
    pub span: (f64, f64),
    /// The recalibrated parameters, in their units.
    pub values: Vec<f64>,
    /// The standard deviations; the width of the prior if the window does not determine the parameter.
    pub sd: Vec<f64>,
}

/// The drift map of a calibrated system.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriftMap {
    /// The parameters by window, in the order of conditions and windows.
    pub pieces: Vec<WindowEstimate>,
    /// Each parameter.
    pub parameters: Vec<DriftingParameter>,
    /// The test of equality of all parameters in all windows.
    pub all: Equality,
    /// The test of equality between whole conditions; `None` with one condition.
    pub conditions: Option<Equality>,
    /// The share of each sensor in the misfit beyond noise, the largest first; empty without sensors.
    pub sensors: Vec<MisfitShare>,
    /// The test of equality without the sensor of the largest share.
    pub without_sensor: Option<Equality>,
    /// The level at which something is missing.
    pub reading: DriftLevel,
    /// The level in words.
    pub words: String,
}

/// The drift map of a calibrated system; `None` without parameters or if the slopes are not finite.
///
/// The cost is one whitening of the slopes per window and simulation, and `refits` linearisations of the model per
/// window.
pub fn drift(
    system: &System<'_>,
    fit: &Fit,
    noise: &Noise,
    whitener: &Whitener,
    options: DriftOptions,
    stream: &Stream,
) -> Option<DriftMap> {
    let experiment = system.experiment;
    let p = experiment.parameters.len();
    if p == 0 || !fit.at.tangents.as_slice().iter().all(|x| x.is_finite()) {
        return None;
    }
    let width: Vec<f64> = system.priors().iter().map(|x| 1.0 / precision(x).sqrt()).collect();
    let common = Matrix::from_fn(fit.at.tangents.rows(), experiment.outputs(), |j, i| {
        fit.at.tangents[(j, i)] * width[j]
    });
    let white = whitener.whiten_rows(&common);
    let leverage = WindowSlopes::new(white.clone(), &white, common.rows())?.leverage();
    let windows = windows(experiment, &leverage, options.windows.max(1));
    let slopes = masked(&windows, p, |_, j| common.row(j));
    let conditions: Vec<Vec<usize>> = (0..experiment.conditions.len())
        .map(|c| (0..windows.len()).filter(|&w| windows[w].condition == c).collect())
        .collect();
    let (_, means) = experiment.means();
    let misfit: Vec<f64> = means.iter().zip(&fit.at.response).map(|(y, m)| y - m).collect();
    let setting = DriftSetting {
        experiment,
        noise,
        response: &fit.at.response,
        misfit: &misfit,
        pieces: &slopes,
        common: &common,
        parameters: p,
        conditions: &conditions,
        simulations: options.simulations,
        stream,
    };
    let (pieces, tests) = setting.tests(whitener)?;
    let pull = pull(&pieces, &fit.residual);
    let refit = Refit { system, fit, whitener, windows: &windows, width: &width, pull: &pull };
    let (deviations, precision) = refit.run(&pieces, options.refits)?;
    let sd = Cholesky::new(&precision).ok()?.inverse();
    let piece = |(w, window): (usize, &Window)| WindowEstimate {
        condition: window.condition,
        scenario: experiment.conditions[window.condition].scenario.clone(),
        span: window.span,
        values: (0..p).map(|j| fit.at.point[j] + width[j] * deviations[w * p + j]).collect(),
        sd: (0..p).map(|j| width[j] * sd[(w * p + j, w * p + j)].sqrt()).collect(),
    };
    let parameters = drifting(experiment, &tests);
    let sensors = shares(experiment, &pieces, &fit.residual);
    let without_sensor = super::reading::without(&setting, &sensors);
    let (reading, words) =
        read(&parameters, &tests.all, &sensors, without_sensor.as_ref(), options.simulations);
    Some(DriftMap {
        pieces: windows.iter().enumerate().map(piece).collect(),
        parameters,
        all: tests.all,
        conditions: tests.conditions,
        sensors,
        without_sensor,
        reading,
        words,
    })
}

/// Slopes that act in one window each: `slope(window, parameter)`, restricted to the outputs of the window.
fn masked<'b>(windows: &[Window], p: usize, slope: impl Fn(usize, usize) -> &'b [f64]) -> Matrix {
    let mut all = Matrix::zeros(windows.len() * p, slope(0, 0).len());
    for (w, window) in windows.iter().enumerate() {
        for j in 0..p {
            let (row, own) = (all.row_mut(w * p + j), slope(w, j));
            window.outputs.iter().for_each(|&i| row[i] = own[i]);
        }
    }
    all
}

/// The part of the score of the windows' parameters that the common unknowns explain. It is subtracted, because the
/// prior already balances it at the joint fit.
fn pull(pieces: &WindowSlopes, residual: &[f64]) -> Vec<f64> {
    let whole = multiply_vector(&pieces.slopes, residual);
    let rest = multiply_vector(&pieces.slopes, &pieces.rest(residual));
    whole.iter().zip(rest).map(|(w, r)| w - r).collect()
}

/// The refit of the parameters of all windows together by the Gauss-Newton method.
struct Refit<'a> {
    system: &'a System<'a>,
    fit: &'a Fit,
    whitener: &'a Whitener,
    windows: &'a [Window],
    width: &'a [f64],
    pull: &'a [f64],
}

/// State of the refit: deviations, whitened residual and slopes, and the objective to be minimised.
struct Stand {
    deviations: Vec<f64>,
    residual: Vec<f64>,
    slopes: Matrix,
    objective: f64,
}

impl Refit<'_> {
    /// Deviations from the joint fit in units of the priors' widths, with their precision.
    fn run(&self, pieces: &WindowSlopes, steps: usize) -> Option<(Vec<f64>, Matrix)> {
        let size = pieces.slopes.rows();
        let mut here = Stand {
            deviations: vec![0.0; size],
            residual: self.fit.residual.clone(),
            slopes: pieces.slopes.clone(),
            objective: 0.5 * dot(&self.fit.residual, &self.fit.residual),
        };
        let first = step(&here, self.pull)?;
        if steps == 0 {
            return Some((first, pieces.precision()));
        }
        for _ in 0..steps {
            let target = step(&here, self.pull)?;
            let next = [1.0, 0.5, 0.2, 0.05].iter().find_map(|share| {
                let between = here.deviations.iter().zip(&target);
                let tried: Vec<f64> = between.map(|(a, b)| a + share * (b - a)).collect();
                self.at(&tried).filter(|next| next.objective < here.objective)
            });
            let Some(next) = next else { break };
            let gain = here.objective - next.objective;
            here = next;
            if gain < GAIN {
                break;
            }
        }
        let mut precision = lacuna_linalg::multiply_transposed(&here.slopes, &here.slopes);
        (0..size).for_each(|j| precision[(j, j)] += 1.0);
        Some((here.deviations, precision))
    }

    /// State with the parameters of each window moved by `deviations` from the joint fit, clamped to their bounds.
    fn at(&self, deviations: &[f64]) -> Option<Stand> {
        let p = deviations.len() / self.windows.len();
        let bounds = self.system.bounds();
        let (_, means) = self.system.experiment.means();
        let mut response = self.fit.at.response.clone();
        let mut clamped = deviations.to_vec();
        let mut tangents = Vec::new();
        for (w, window) in self.windows.iter().enumerate() {
            let mut point = self.fit.at.point.clone();
            for j in 0..p {
                let moved = point[j] + self.width[j] * deviations[w * p + j];
                let inside = moved.max(bounds[j].0).min(bounds[j].1);
                clamped[w * p + j] = (inside - point[j]) / self.width[j];
                point[j] = inside;
            }
            let own = self.system.linearised(&point);
            window.outputs.iter().for_each(|&i| response[i] = own.response[i]);
            tangents.push(own.tangents);
        }
        let mut slopes = masked(self.windows, p, |w, j| tangents[w].row(j));
        for a in 0..slopes.rows() {
            slopes.row_mut(a).iter_mut().for_each(|x| *x *= self.width[a % p]);
        }
        let misfit: Vec<f64> = means.iter().zip(&response).map(|(y, m)| y - m).collect();
        let residual = self.whitener.whiten(&misfit);
        let objective = 0.5 * dot(&residual, &residual)
            + 0.5 * dot(&clamped, &clamped)
            + dot(self.pull, &clamped);
        let finite = objective.is_finite() && slopes.as_slice().iter().all(|x| x.is_finite());
        let slopes = if finite { self.whitener.whiten_rows(&slopes) } else { slopes };
        finite.then_some(Stand { deviations: clamped, residual, slopes, objective })
    }
}

/// The deviations after a full Gauss-Newton step.
fn step(here: &Stand, pull: &[f64]) -> Option<Vec<f64>> {
    let mut precision = lacuna_linalg::multiply_transposed(&here.slopes, &here.slopes);
    (0..precision.rows()).for_each(|j| precision[(j, j)] += 1.0);
    let mut shift = multiply_vector(&here.slopes, &here.residual);
    for (s, (d, b)) in shift.iter_mut().zip(here.deviations.iter().zip(pull)) {
        *s -= d + b;
    }
    Cholesky::new(&precision).ok()?.solve(&mut shift);
    Some(here.deviations.iter().zip(shift).map(|(d, s)| d + s).collect())
}

//! The map: values by piece, tests with a simulated null, and what they say.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::equality::{Equality, Pieces, Tests};
use super::pieces::{Window, windows};
use super::reading::{Reading, Share, read, shares};
use crate::data::Parameter;
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, precision};
use crate::gap::locate::{common_error, probability};
use crate::gap::noise::{Around, Noise};
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::linalg::vector::dot;
use crate::linalg::{Cholesky, Matrix, multiply_vector};
use crate::math::random::Stream;

/// A refit that gains less of the log density ends.
const GAIN: f64 = 1e-4;

/// How a map is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// The most windows of a condition.
    pub windows: usize,
    /// The most steps of the exact refit of all pieces, each of one linearisation of the model a piece; with none the
    /// values are those along the slopes of the joint fit.
    pub refits: usize,
    /// Simulations of the tests' null with the noise estimated anew; without any the noise counts as known, which a
    /// few replicates make too sure.
    pub simulations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { windows: 4, refits: 5, simulations: 199 }
    }
}

/// The parameters in one piece of the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// Its condition's place in the experiment.
    pub condition: usize,
    /// The scenario's name; `None` where the study has none.
    pub scenario: Option<String>,
    /// The first and the last place along the last axis, in its unit.
    pub span: (f64, f64),
    /// The parameters, recalibrated: in their units.
    pub values: Vec<f64>,
    /// Their standard deviations; a prior's width where the piece says nothing.
    pub sd: Vec<f64>,
}

/// How a parameter differs between the pieces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Drifting {
    /// Its name.
    pub name: String,
    /// The test of equality when all other parameters may differ too.
    pub equality: Equality,
    /// The test of equality when the others are the same everywhere.
    pub alone: Equality,
    /// The share of all differences that this parameter alone would explain, by the statistics' excess over their
    /// freedom.
    pub explains: f64,
}

/// The map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// The parameters by piece, in the order of conditions and windows.
    pub pieces: Vec<Piece>,
    /// Each parameter.
    pub parameters: Vec<Drifting>,
    /// The test of equality of all parameters in all pieces.
    pub all: Equality,
    /// The same between whole conditions; `None` with one.
    pub conditions: Option<Equality>,
    /// Each sensor's share of the misfit beyond noise, the largest first; without sensors none.
    pub sensors: Vec<Share>,
    /// The test of equality without the sensor of the largest share.
    pub without_sensor: Option<Equality>,
    /// What it says.
    pub reading: Reading,
    /// The same in words.
    pub words: String,
}

/// What all parts of a map work with.
pub(super) struct Bench<'a> {
    pub experiment: &'a Experiment<'a>,
    pub noise: &'a Noise,
    pub response: &'a [f64],
    /// Differences of the means from the response.
    pub misfit: &'a [f64],
    /// The slopes of the pieces, and of all unknowns, in units of the priors' widths.
    pub pieces: &'a Matrix,
    pub common: &'a Matrix,
    pub parameters: usize,
    /// The pieces of each condition.
    pub conditions: &'a [Vec<usize>],
    pub simulations: usize,
    pub stream: &'a Stream,
}

impl Bench<'_> {
    fn whitened(&self, whitener: &Whitener) -> Option<Pieces> {
        let slopes = whitener.whiten_rows(self.pieces);
        Pieces::new(slopes, &whitener.whiten_rows(self.common), self.parameters)
    }

    /// The tests, with their simulated null where simulations are asked for.
    pub fn tests(&self, whitener: &Whitener) -> Option<(Pieces, Tests)> {
        let pieces = self.whitened(whitener)?;
        let mut tests = pieces.tests(&whitener.whiten(self.misfit), self.conditions)?;
        if self.simulations > 0 {
            let simulated: Vec<Option<Vec<f64>>> = (0..self.simulations)
                .into_par_iter()
                .map(|b| self.simulated(&self.stream.at(b as u64)))
                .collect();
            let simulated: Vec<Vec<f64>> = simulated.into_iter().flatten().collect();
            for (k, test) in tests.each().into_iter().enumerate() {
                let null: Vec<f64> = simulated.iter().map(|each| each[k]).collect();
                if test.freedom > 0 {
                    test.p = probability(&null, test.standardised());
                }
            }
        }
        Some((pieces, tests))
    }

    fn simulated(&self, stream: &Stream) -> Option<Vec<f64>> {
        let replicates = self.noise.simulate(self.experiment, self.response, stream);
        let simulated = self.experiment.with_replicates(replicates);
        let error = common_error(self.experiment, self.noise, &stream.named("common"));
        let (_, means) = simulated.means();
        let around = Around { response: self.response.to_vec(), slopes: self.common.clone() };
        let noise = Noise::of(&simulated, &around, Some(self.noise));
        let whitener = Whitener::new(&simulated, &noise, self.response);
        let misfit: Vec<f64> =
            (0..means.len()).map(|i| means[i] - self.response[i] + error[i]).collect();
        let pieces = self.whitened(&whitener)?;
        let mut tests = pieces.tests(&whitener.whiten(&misfit), self.conditions)?;
        Some(tests.each().into_iter().map(|test| test.standardised()).collect())
    }
}

/// The drift map of a calibrated system; `None` without parameters or where its slopes have no value.
///
/// Costs one whitening of the slopes for each piece and simulation, and `refits` linearisations of the model a piece.
pub fn drift(
    system: &System<'_>,
    fit: &Fit,
    noise: &Noise,
    whitener: &Whitener,
    options: Options,
    stream: &Stream,
) -> Option<Map> {
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
    let leverage = Pieces::new(white.clone(), &white, common.rows())?.leverage();
    let windows = windows(experiment, &leverage, options.windows.max(1));
    let slopes = masked(&windows, p, |_, j| common.row(j));
    let conditions: Vec<Vec<usize>> = (0..experiment.conditions.len())
        .map(|c| (0..windows.len()).filter(|&w| windows[w].condition == c).collect())
        .collect();
    let (_, means) = experiment.means();
    let misfit: Vec<f64> = means.iter().zip(&fit.at.response).map(|(y, m)| y - m).collect();
    let bench = Bench {
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
    let (pieces, tests) = bench.tests(whitener)?;
    let pull = pull(&pieces, &fit.residual);
    let refit = Refit { system, fit, whitener, windows: &windows, width: &width, pull: &pull };
    let (deviations, precision) = refit.run(&pieces, options.refits)?;
    let sd = Cholesky::new(&precision).ok()?.inverse();
    let piece = |(w, window): (usize, &Window)| Piece {
        condition: window.condition,
        scenario: experiment.conditions[window.condition].scenario.clone(),
        span: window.span,
        values: (0..p).map(|j| fit.at.point[j] + width[j] * deviations[w * p + j]).collect(),
        sd: (0..p).map(|j| width[j] * sd[(w * p + j, w * p + j)].sqrt()).collect(),
    };
    let parameters = drifting(experiment, &tests);
    let sensors = shares(experiment, &pieces, &fit.residual);
    let without_sensor = super::reading::without(&bench, &sensors);
    let (reading, words) = read(&parameters, &tests.all, &sensors, without_sensor.as_ref());
    Some(Map {
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

/// How each parameter differs.
fn drifting(experiment: &Experiment<'_>, tests: &Tests) -> Vec<Drifting> {
    let excess = |e: &Equality| (e.statistic - e.freedom as f64).max(0.0);
    let whole = excess(&tests.all).max(f64::MIN_POSITIVE);
    let each = tests.marginal.iter().zip(&tests.alone);
    let of = |(parameter, (equality, alone)): (&Parameter, (&Equality, &Equality))| Drifting {
        name: parameter.name.clone(),
        equality: *equality,
        alone: *alone,
        explains: (excess(alone) / whole).min(1.0),
    };
    experiment.parameters.iter().zip(each).map(of).collect()
}

/// Slopes that act in one window each: `slope(window, parameter)`, of which the window's outputs count.
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

/// The slopes that the prior balances at the joint fit: no drift.
fn pull(pieces: &Pieces, residual: &[f64]) -> Vec<f64> {
    let whole = multiply_vector(&pieces.slopes, residual);
    let rest = multiply_vector(&pieces.slopes, &pieces.rest(residual));
    whole.iter().zip(rest).map(|(w, r)| w - r).collect()
}

/// The refit of the parameters of all pieces together, by the method of Gauss and Newton.
struct Refit<'a> {
    system: &'a System<'a>,
    fit: &'a Fit,
    whitener: &'a Whitener,
    windows: &'a [Window],
    width: &'a [f64],
    pull: &'a [f64],
}

/// The refit as it stands: deviations, whitened residual and slopes, and what is to be made small.
struct Stand {
    deviations: Vec<f64>,
    residual: Vec<f64>,
    slopes: Matrix,
    objective: f64,
}

impl Refit<'_> {
    /// Deviations from the joint fit in units of the priors' widths, with their precision.
    fn run(&self, pieces: &Pieces, steps: usize) -> Option<(Vec<f64>, Matrix)> {
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
        let mut precision = crate::linalg::multiply_transposed(&here.slopes, &here.slopes);
        (0..size).for_each(|j| precision[(j, j)] += 1.0);
        Some((here.deviations, precision))
    }

    /// Where each piece has its own parameters, inside their bounds.
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

/// The deviations to which a full step leads.
fn step(here: &Stand, pull: &[f64]) -> Option<Vec<f64>> {
    let mut precision = crate::linalg::multiply_transposed(&here.slopes, &here.slopes);
    (0..precision.rows()).for_each(|j| precision[(j, j)] += 1.0);
    let mut shift = multiply_vector(&here.slopes, &here.residual);
    for (s, (d, b)) in shift.iter_mut().zip(here.deviations.iter().zip(pull)) {
        *s -= d + b;
    }
    Cholesky::new(&precision).ok()?.solve(&mut shift);
    Some(here.deviations.iter().zip(shift).map(|(d, s)| d + s).collect())
}

//! The constants of a companion, identified from simulation runs by least squares.
//!
//! Levenberg and Marquardt's method inside the bounds of the priors, as for the fits of the search, from several starts.
//! The error of a companion is a share of the response, so that the residuals are in units of the gate; the priors decide
//! only where the runs do not.

use lacuna::data::Ensemble;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna::plugin::forward::Wanted;
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, gram, multiply_vector};

use super::gate::{Split, scale};
use crate::gap::system::coordinate::{Coordinate, inner, log_slope};
use crate::gap::system::step::within;
use crate::stage::direct::ModelMap;
use crate::study::gap::companion::Companion;

/// The number of starts: the medians of the priors, and draws from them.
const STARTS: usize = 4;

/// The number of steps from each start, after which the best one goes on.
const FIRST: usize = 5;

/// The largest number of steps of the best one.
const STEPS: usize = 40;

/// The smallest gain in log density at which a fit goes on.
const GAIN: f64 = 1e-2;

/// The largest number of tries of a step, each with ten times the damping.
const TRIES: usize = 6;

/// The runs and the companion whose constants are sought.
struct Identification<'a, 'b> {
    map: &'b ModelMap<'a>,
    ensemble: &'b Ensemble,
    runs: &'b [usize],
    own: usize,
    priors: Vec<Distribution>,
    coordinates: Vec<Coordinate>,
    bounds: Vec<(f64, f64)>,
    /// The standard deviation of the companion's error, in the response's unit.
    sd: f64,
}

/// Constants with their log density.
struct Fit {
    constants: Vec<f64>,
    height: f64,
    damping: f64,
}

/// The constants of largest posterior density, in their units.
pub(super) fn constants(
    map: &ModelMap<'_>,
    companion: &Companion,
    ensemble: &Ensemble,
    split: &Split,
    random: &Stream,
) -> Result<Vec<f64>, Stop> {
    let own = companion.own();
    let priors: Vec<Distribution> =
        companion.study.parameters[own..].iter().map(|p| p.prior.clone()).collect();
    let coordinates = priors.iter().map(Coordinate::of).collect();
    let bounds = priors.iter().map(|prior| inner(prior, prior.support())).collect();
    let sd = companion.keys.gate.get() * scale(ensemble, &split.identify);
    let runs = &split.identify;
    let identification =
        Identification { map, ensemble, runs, own, priors, coordinates, bounds, sd };
    identification.best(random)
}

impl Identification<'_, '_> {
    fn best(&self, random: &Stream) -> Result<Vec<f64>, Stop> {
        let mut begun: Vec<Fit> = Vec::new();
        for start in 0..STARTS {
            let mut rng = random.at(start as u64).generator();
            let value = |prior: &Distribution| {
                if start == 0 { prior.quantile(0.5) } else { prior.sample(&mut rng) }
            };
            let point: Vec<f64> = self.priors.iter().map(value).collect();
            let mut fit = self.from(self.clamped(point));
            self.climb(&mut fit, FIRST)?;
            begun.push(fit);
        }
        begun.sort_by(|a, b| b.height.total_cmp(&a.height));
        let mut best = begun.swap_remove(0);
        if !best.height.is_finite() {
            let why = self.map.tally().map_or(String::new(), |why| format!(": {why}"));
            return Err(Stop::new(format!("the companion has no answer to the runs{why}")));
        }
        self.climb(&mut best, STEPS)?;
        Ok(best.constants)
    }

    fn clamped(&self, point: Vec<f64>) -> Vec<f64> {
        point.iter().zip(&self.bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect()
    }

    fn from(&self, constants: Vec<f64>) -> Fit {
        let height = self.height(&constants);
        Fit { constants, height, damping: 1e-3 }
    }

    /// The log density in the searched coordinates, without constants.
    fn height(&self, constants: &[f64]) -> f64 {
        let points = super::gate::points(self.ensemble, self.runs, constants);
        let answers = self.map.mean(&points);
        let square: f64 = (0..self.runs.len())
            .map(|k| {
                let pairs = self.ensemble.responses.row(self.runs[k]).iter().zip(answers.row(k));
                pairs.map(|(y, c)| ((y - c) / self.sd).powi(2)).sum::<f64>()
            })
            .sum();
        let prior: f64 = self.priors.iter().zip(constants).map(|(p, &x)| p.log_density(x)).sum();
        let all = prior + log_slope(&self.priors, constants) - 0.5 * square;
        if all.is_finite() { all } else { f64::NEG_INFINITY }
    }

    /// Climbs by at most so many steps, or to the end.
    fn climb(&self, fit: &mut Fit, steps: usize) -> Result<(), Stop> {
        for _ in 0..steps {
            if !fit.height.is_finite() || !self.step(fit) {
                break;
            }
        }
        match self.map.failure() {
            Some(fatal) => Err(Stop::new(format!("the companion: {fatal}"))),
            None => Ok(()),
        }
    }

    /// Takes a step; false at the end of the climb.
    fn step(&self, fit: &mut Fit) -> bool {
        let (slopes, residual) = self.linearised(&fit.constants);
        let x = &fit.constants;
        let coordinates = || self.coordinates.iter().zip(x);
        let units: Vec<f64> = coordinates().map(|(own, &x)| own.unit(x)).collect();
        let mut gradient = multiply_vector(&slopes, &residual);
        let mut hessian = gram(&slopes.transposed());
        for (j, own) in self.coordinates.iter().enumerate() {
            gradient[j] = (gradient[j] + own.slope(x[j])) * units[j];
            hessian[(j, j)] += own.curvature(x[j]);
        }
        let room = coordinates().zip(&self.bounds).map(|((own, &x), b)| own.room(x, *b));
        let (low, high): (Vec<f64>, Vec<f64>) = room.unzip();
        for _ in 0..TRIES {
            let damped = Matrix::from_fn(x.len(), x.len(), |i, j| {
                let value = units[i] * hessian[(i, j)] * units[j];
                if i == j { value * (1.0 + fit.damping) + fit.damping } else { value }
            });
            let Some(shift) = within(&damped, &gradient, &low, &high) else { return false };
            let next = coordinates().zip(&shift).map(|((own, &x), s)| own.moved(x, *s));
            let next = self.clamped(next.collect());
            let height = self.height(&next);
            if height > fit.height {
                let gain = height - fit.height;
                (fit.constants, fit.height) = (next, height);
                fit.damping = (fit.damping * 0.1).max(1e-9);
                return gain > GAIN;
            }
            fit.damping = (fit.damping * 10.0).max(1e-4);
        }
        false
    }

    /// The slopes by the constants, `constants x values`, and the residuals, in units of the companion's error.
    fn linearised(&self, constants: &[f64]) -> (Matrix, Vec<f64>) {
        let columns: Vec<usize> = (self.own..self.own + constants.len()).collect();
        let points = super::gate::points(self.ensemble, self.runs, constants);
        let (mut rows, mut residual) = (vec![Vec::new(); constants.len()], Vec::new());
        for (k, &r) in self.runs.iter().enumerate() {
            let (answer, jacobian) =
                self.map.mean_and_jacobian_by(points.row(k), Wanted::by(&columns));
            let run = self.ensemble.responses.row(r);
            residual.extend(run.iter().zip(&answer).map(|(y, c)| (y - c) / self.sd));
            for (j, row) in rows.iter_mut().enumerate() {
                row.extend((0..answer.len()).map(|i| jacobian[(i, j)] / self.sd));
            }
        }
        // A constant without a slope there stays where it is.
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        let rows = rows.into_iter().map(|row| row.into_iter().map(finite).collect::<Vec<f64>>());
        let slopes = Matrix::from_rows(residual.len(), rows);
        (slopes, residual)
    }
}

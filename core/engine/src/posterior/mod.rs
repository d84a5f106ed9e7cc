//! Priors and a log-likelihood combined into one log density with its gradient.
//!
//! Coordinates, in this order: the model's parameters in physical units; the parameters of the study's effects; the
//! discrepancy's hyperparameters. A hyperparameter that is declared `log` is represented by its logarithm, and the
//! density includes the Jacobian, so that its prior keeps its meaning. Members of populations have coordinates of their own
//! (`members`).

use std::sync::Arc;

use lacuna::data::{JointPrior, Parameter, Population};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::forward::Numbers;
use lacuna::plugin::{Fact, Hyperparameter, Target};
use lacuna_linalg::Matrix;
use rand::Rng;
use rayon::prelude::*;

pub mod bridge;
mod conditional;
mod given;
mod information;
mod joint;
mod members;
mod mode;
mod of_data;
mod pace;
mod pooled;
mod scales;

pub use conditional::CutValues;
pub use given::Given;
pub use information::Together;
pub use joint::Joint;
pub use mode::Mode;
pub use of_data::OfData;
pub use scales::CoordinateScale;

use members::{Jacobian, Members};
use pace::Pace;

/// Number of points that are evaluated together. It is fixed because the rounding of a matrix product depends on the
/// number of its rows, and results must not depend on the number of threads.
const BATCH: usize = 30;

/// Log-likelihood as a function of natural values of the parameters and of further unknowns.
pub trait LogLikelihood: Send + Sync {
    /// Unknowns besides the parameters.
    fn hyperparameters(&self) -> &[Hyperparameter];

    /// Populations of these unknowns, by their places among them. The unknowns of a population are among them too.
    fn populations(&self) -> &[Population] {
        &[]
    }

    /// Log-likelihood for each row of `theta` (`points x parameters`) and `hyper` (`points x hyperparameters`).
    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64>;

    /// Number of runs of a stochastic model from which each value is estimated; `None` if the values are not estimates.
    fn runs(&self) -> Option<usize> {
        None
    }

    /// Like [`LogLikelihood::values`], estimated with these random numbers.
    fn estimates(&self, theta: &Matrix, hyper: &Matrix, _numbers: Numbers) -> Vec<f64> {
        self.values(theta, hyper)
    }

    /// Log-likelihood at one point and its derivatives, by the parameters and then by the hyperparameters.
    fn value_and_gradient(&self, theta: &[f64], hyper: &[f64]) -> (f64, Vec<f64>);

    /// A cheap log-likelihood that agrees with this one in value and gradient at these parameters, whatever the
    /// hyperparameters; `None` if there is none.
    fn linearised(&self, _theta: &[f64]) -> Option<Box<dyn LogLikelihood + '_>> {
        None
    }

    /// Facts for the report.
    fn facts(&self) -> Vec<Fact>;

    /// Reason why the log-likelihood can no longer be computed; `None` while it works.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// The posterior of a study.
pub struct Posterior<'a> {
    prior: JointPrior<'a>,
    likelihood: Arc<dyn LogLikelihood + 'a>,
    region: Option<Vec<(f64, f64)>>,
    members: Members,
    numbers: Numbers,
    pace: Pace,
}

impl<'a> Posterior<'a> {
    /// The posterior with the prior of its parameters.
    pub fn new(prior: impl Into<JointPrior<'a>>, likelihood: impl LogLikelihood + 'a) -> Self {
        let prior = prior.into();
        let parameters = prior.parameters().len();
        let besides = likelihood.populations().iter().map(|own| own.behind(parameters));
        let all = prior.dependence().populations.iter().cloned().chain(besides);
        let members = Members::of(all.collect());
        let numbers = Numbers::OfPoint;
        let (likelihood, pace) = (Arc::new(likelihood), Pace::default());
        Self { prior, likelihood, region: None, members, numbers, pace }
    }

    /// The same density, estimated with these random numbers.
    #[must_use]
    pub fn with_numbers(&self, numbers: Numbers) -> Self {
        Self { numbers, ..self.with_members(self.members.clone()) }
    }

    /// Number of runs of a stochastic model from which the likelihood at a point is estimated; `None` if it is not estimated.
    /// The estimate at a point is always the same one.
    pub fn runs(&self) -> Option<usize> {
        self.likelihood.runs()
    }

    fn with_members(&self, members: Members) -> Self {
        Self { members, ..self.with_likelihood(self.likelihood.clone()) }
    }

    /// Restricts each parameter to its interval; the density is zero elsewhere.
    pub fn within(self, region: Option<Vec<(f64, f64)>>) -> Self {
        Self { region, ..self }
    }

    fn is_inside(&self, natural: &[f64]) -> bool {
        let region = self.region.iter().flatten();
        region.zip(natural).all(|(&(low, high), &x)| low <= x && x <= high)
    }

    /// Parameters of the model.
    pub fn parameters(&self) -> &[Parameter] {
        self.prior.parameters()
    }

    /// Joint prior of the parameters.
    pub fn prior(&self) -> JointPrior<'_> {
        self.prior
    }

    /// Facts about the likelihood, for the report.
    pub fn facts(&self) -> Vec<Fact> {
        self.likelihood.facts()
    }

    /// Unknowns besides the model's parameters.
    pub fn hyperparameters(&self) -> &[Hyperparameter] {
        self.likelihood.hyperparameters()
    }

    /// Natural values at a point of the coordinates.
    pub fn natural(&self, point: &[f64]) -> Vec<f64> {
        let mut natural = self.map_logs(point, f64::exp);
        self.members.natural(&mut natural);
        natural
    }

    /// Coordinates of natural values.
    pub fn coordinates(&self, natural: &[f64]) -> Vec<f64> {
        let mut point = natural.to_vec();
        self.members.coordinates(&mut point);
        self.map_logs(&point, f64::ln)
    }

    fn map_logs(&self, point: &[f64], map: impl Fn(f64) -> f64) -> Vec<f64> {
        let d = self.parameters().len();
        let is_log = |i: usize| i >= d && self.hyperparameters()[i - d].log;
        point.iter().enumerate().map(|(i, &x)| if is_log(i) { map(x) } else { x }).collect()
    }

    /// Prior of each coordinate's natural value alone.
    pub fn priors(&self) -> impl Iterator<Item = &Distribution> {
        let parameters = self.parameters().iter().map(|p| &p.prior);
        parameters.chain(self.hyperparameters().iter().map(|h| &h.prior))
    }

    /// Log prior density of natural values.
    fn log_prior(&self, natural: &[f64]) -> f64 {
        if !self.is_inside(natural) {
            return f64::NEG_INFINITY;
        }
        let each = self.priors().zip(natural).enumerate().filter(|(j, _)| self.has_own(*j));
        let own: f64 = each.map(|(_, (prior, &x))| prior.log_density(x)).sum();
        if own == f64::NEG_INFINITY || (self.prior.is_independent() && self.members.is_empty()) {
            return own;
        }
        let besides: f64 = self.besides().iter().map(|p| p.log_density_of_members(natural)).sum();
        own + self.prior.joint(&natural[..self.parameters().len()]) + besides
    }

    /// Log Jacobian of the coordinates: for logarithms the sum of these coordinates, unless only that of the members is asked.
    fn log_jacobian(&self, point: &[f64], natural: &[f64], jacobian: bool) -> f64 {
        let d = self.parameters().len();
        let logs =
            self.hyperparameters().iter().zip(&point[d..]).filter(|(h, _)| h.log && jacobian);
        let logs: f64 = logs.map(|(_, &x)| x).sum();
        if self.members.is_empty() {
            return logs;
        }
        logs + self.members.log_jacobian(natural, of_members(jacobian))
    }

    fn batch(&self, points: &Matrix, jacobian: bool) -> Vec<f64> {
        let starts: Vec<usize> = (0..points.rows()).step_by(BATCH).collect();
        let part = |start: usize| {
            let rows: Vec<usize> = (start..points.rows().min(start + BATCH)).collect();
            self.pace.of(rows.len(), || self.block(&points.select_rows(&rows), jacobian))
        };
        let parts: Vec<Vec<f64>> = if self.pace.is_short(points.rows()) {
            starts.into_iter().map(part).collect()
        } else {
            starts.into_par_iter().map(part).collect()
        };
        parts.concat()
    }

    fn block(&self, points: &Matrix, jacobian: bool) -> Vec<f64> {
        let d = self.parameters().len();
        let natural: Vec<Vec<f64>> = points.iter_rows().map(|p| self.natural(p)).collect();
        let mut density: Vec<f64> = natural
            .iter()
            .zip(points.iter_rows())
            .map(|(x, p)| self.log_prior(x) + self.log_jacobian(p, x, jacobian))
            .collect();
        let inside: Vec<usize> = (0..points.rows()).filter(|&i| density[i].is_finite()).collect();
        if !inside.is_empty() {
            let theta = Matrix::from_rows(d, inside.iter().map(|&i| &natural[i][..d]));
            let hyper = Matrix::from_rows(
                self.hyperparameters().len(),
                inside.iter().map(|&i| &natural[i][d..]),
            );
            let values = self.likelihood.estimates(&theta, &hyper, self.numbers);
            for (&i, value) in inside.iter().zip(values) {
                density[i] += value;
            }
        }
        // NaN (an overflow far from the data) counts as zero density.
        density.iter().map(|&v| if v.is_nan() { f64::NEG_INFINITY } else { v }).collect()
    }

    fn value_and_gradient(&self, point: &[f64], jacobian: bool) -> (f64, Vec<f64>) {
        let d = self.parameters().len();
        let natural = self.natural(point);
        let nothing = || (f64::NEG_INFINITY, vec![0.0; point.len()]);
        let prior = self.log_prior(&natural) + self.log_jacobian(point, &natural, jacobian);
        if !prior.is_finite() {
            return nothing();
        }
        let (value, mut gradient) =
            self.likelihood.value_and_gradient(&natural[..d], &natural[d..]);
        let value = prior + value;
        if !value.is_finite() {
            return nothing();
        }
        for (j, ((g, prior), &x)) in
            gradient.iter_mut().zip(self.priors()).zip(&natural).enumerate()
        {
            if self.has_own(j) {
                *g += prior.log_density_derivative(x);
            }
        }
        self.prior.add_joint_gradient(&natural[..d], &mut gradient);
        self.besides().iter().for_each(|own| own.add_gradient(&natural, &mut gradient));
        self.members.pull_back(&natural, of_members(jacobian), &mut gradient);
        for (i, hyper) in self.hyperparameters().iter().enumerate().filter(|(_, h)| h.log) {
            debug_assert!(hyper.log);
            let g = &mut gradient[d + i];
            *g = *g * natural[d + i] + if jacobian { 1.0 } else { 0.0 };
        }
        (value, gradient)
    }

    fn coordinate_bounds(&self) -> Vec<(f64, f64)> {
        let plain = self.parameters().iter().enumerate().map(|(i, p)| {
            let (low, high) = p.prior.support();
            self.region.as_ref().map_or((low, high), |r| (low.max(r[i].0), high.min(r[i].1)))
        });
        let hyper = self.hyperparameters().iter().map(|h| {
            let (low, high) = h.prior.support();
            if h.log { (low.max(0.0).ln(), high.ln()) } else { (low, high) }
        });
        let mut bounds: Vec<(f64, f64)> = plain.chain(hyper).collect();
        self.members.bounds(&mut bounds);
        bounds
    }

    /// A draw from the prior of coordinate `j`, inside the region.
    fn draw(&self, j: usize, prior: &Distribution, rng: &mut impl Rng) -> f64 {
        match self.region.as_ref().and_then(|region| region.get(j)) {
            Some(&(low, high)) => {
                let (from, to) = (prior.cdf(low), prior.cdf(high));
                prior.quantile(from + (to - from) * uniform(rng)).clamp(low, high)
            }
            None => prior.sample(rng),
        }
    }

    /// Logarithm of the prior probability of the region, and its standard error.
    pub fn log_share(&self) -> (f64, f64) {
        let d = self.parameters().len();
        if self.region.is_some() && !self.prior.is_independent() {
            let stream = Stream::root(0).named("region");
            let share = self.prior.share_of(&stream, |point| self.is_inside(&point[..d]));
            return (share.log(), share.log_error());
        }
        let region = self.region.iter().flatten();
        let share = |(&(low, high), prior): (&(f64, f64), &Distribution)| {
            (prior.cdf(high) - prior.cdf(low)).ln()
        };
        (region.zip(self.priors()).map(share).sum(), 0.0)
    }

    fn draws(&self, count: usize, stream: &Stream) -> Matrix {
        let d = self.parameters().len() + self.hyperparameters().len();
        let draw = |i: usize| {
            let mut rng = stream.at(i as u64).generator();
            let mut natural = if self.prior.is_independent() {
                Vec::new()
            } else {
                self.prior.sample_where(&mut rng, |point| self.is_inside(point))
            };
            let rest = self.priors().enumerate().skip(natural.len());
            natural.extend(rest.map(|(j, p)| self.draw(j, p, &mut rng)));
            self.besides().iter().for_each(|own| own.draw_members(&mut natural, &mut rng));
            self.coordinates(&natural)
        };
        Matrix::from_rows(d, (0..count).map(draw))
    }
}

/// Jacobian of the members' coordinates for that of logarithmic ones.
fn of_members(jacobian: bool) -> Jacobian {
    if jacobian { Jacobian::Whole } else { Jacobian::Marginal }
}

impl Target for Posterior<'_> {
    fn failure(&self) -> Option<String> {
        self.likelihood.failure()
    }

    fn dimension(&self) -> usize {
        self.parameters().len() + self.hyperparameters().len()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.batch(points, true)
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        points
            .iter_rows()
            .map(|p| {
                let natural = self.natural(p);
                self.log_prior(&natural) + self.log_jacobian(p, &natural, true)
            })
            .collect()
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        self.value_and_gradient(point, true)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.coordinate_bounds()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.draws(count, stream)
    }
}

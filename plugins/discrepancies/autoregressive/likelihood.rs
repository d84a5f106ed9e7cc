//! Likelihood of the autoregressive process, step by step.
//!
//! With `rho = exp(-gap / tau)`, `w = 1 / (1 - rho^2)` and standard deviations `s`, a value `y` after `x` adds
//! `log(2 pi s_y^2 / w) + w ((y - m_y)/s_y - rho (x - m_x)/s_x)^2` to minus twice the log density of a replicate.
//! Summed over the replicates of a step, only its [statistics](super::steps::Step) remain. The common errors `F zeta`
//! make the whitened residuals of the means a linear regression on `zeta`, whose estimate and covariance `C^-1` follow
//! from a Cholesky factor. Derivatives are those of the joint density of data and `zeta`, averaged over `zeta` given
//! the data (Fisher's identity).

use std::f64::consts::TAU;

use lacuna::data::Measurements;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{ErrorPath, Hyperparameter, Known, Likelihood, VariancePart};
use lacuna::run::Stop;
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix};

use super::Autoregressive;
use super::steps::{Step, for_each_step, places, steps};
use crate::discrepancies::common::{
    Groups, Noise, PerGroup, Replicates, Series, Unknown, conditional,
};

/// Likelihood of the autoregressive process (see the module).
pub(super) struct AutoregressiveLikelihood {
    noise: Noise,
    hyper: Vec<Hyperparameter>,
    replicates: Replicates,
    series: Series,
    steps: Vec<Step>,
    /// Factor of the common errors at the measured outputs (`measured x rank`).
    factor: Matrix,
    time: PerGroup,
    /// Groups of series with a common correlation time.
    times: Groups,
}

/// Coefficients of one step at given hyperparameters.
#[derive(Clone, Copy)]
struct Law {
    rho: f64,
    /// `1 / (1 - rho^2)`.
    w: f64,
    /// Standard deviations of the value and of the one before.
    sd: [f64; 2],
}

impl Law {
    /// Returns the weights of the residuals of the value and of the one before in the whitened residual.
    fn weights(&self) -> [f64; 2] {
        let root = self.w.sqrt();
        [root / self.sd[0], -root * self.rho / self.sd[1]]
    }

    /// Returns the quadratic form of second moments of the residuals: of the value, of both, of the one before.
    fn quadratic(&self, moments: [f64; 3]) -> f64 {
        let [a, b] = self.weights();
        a * a * moments[0] + 2.0 * a * b * moments[1] + b * b * moments[2]
    }
}

/// Likelihood and intermediate results at one response and one set of hyperparameters.
struct Solved {
    log_likelihood: f64,
    laws: Vec<Law>,
    zeta: Vec<f64>,
    capacitance: Cholesky,
}

impl AutoregressiveLikelihood {
    pub(super) fn new(options: &Autoregressive, known: &Known<'_>) -> Result<Self, Stop> {
        Self::under(options, known, known.data)
    }

    /// Builds the likelihood of `known.data`, with measured variances taken from the replicates of `shown`.
    pub(super) fn under(
        options: &Autoregressive,
        known: &Known<'_>,
        shown: &Measurements,
    ) -> Result<Self, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let series = Series::of(layout, options.along.as_deref()).map_err(Stop::new)?;
        let times = Groups::of(layout, &options.correlation_by).map_err(Stop::new)?;
        let times = times.with_data(&replicates.measured);
        let mut hyper = Vec::new();
        let noise =
            Noise::new(known, shown, &replicates, (&options.variance, &options.by), &mut hyper)?;
        let name = Unknown { name: "correlation_time", unit: series.unit.clone() };
        let length = series.grid.last().zip(series.grid.first()).map_or(0.0, |(b, a)| b - a);
        let spacing = length / (series.grid.len() as f64 - 1.0).max(1.0);
        let begin = |_| if spacing > 0.0 { spacing } else { 1.0 };
        let time = PerGroup::new(&options.correlation_time, &times, &name, begin, &mut hyper);
        Ok(Self {
            steps: steps(known.data, &replicates, &series),
            factor: replicates.common_factor(known.common)?,
            noise,
            hyper,
            replicates,
            series,
            time,
            times,
        })
    }

    /// Returns the standard deviation of each measured output; `None` if a variance is not positive.
    fn sds(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let groups = self.noise.variance.values(hyper)?;
        let variance = self.noise.by_measured(&self.replicates, groups);
        Some(variance.iter().map(|v| v.sqrt()).collect())
    }

    /// Returns the correlation time of a measured output.
    fn time_of(&self, measured: usize, times: &[f64]) -> f64 {
        self.times.of[self.replicates.measured[measured]].map_or(f64::NAN, |g| times[g])
    }

    fn law(&self, at: usize, before: Option<usize>, gap: f64, sds: &[f64], times: &[f64]) -> Law {
        let Some(before) = before else {
            return Law { rho: 0.0, w: 1.0, sd: [sds[at], 1.0] };
        };
        let x = gap / self.time_of(at, times);
        Law { rho: (-x).exp(), w: -1.0 / (-2.0 * x).exp_m1(), sd: [sds[at], sds[before]] }
    }

    /// Returns the mean residuals of a step: of the value and of the one before.
    fn residual(&self, step: &Step, response: &[f64]) -> [f64; 2] {
        let of = |k: usize| response[self.replicates.measured[k]];
        [step.mean[0] - of(step.at), step.before.map_or(0.0, |b| step.mean[1] - of(b))]
    }

    fn solve(&self, response: &[f64], hyper: &[f64]) -> Option<Solved> {
        let (sds, times) = (self.sds(hyper)?, self.time.values(hyper)?);
        let rank = self.factor.columns();
        let mut white = Vec::with_capacity(self.steps.len());
        let mut whitened = Matrix::zeros(self.steps.len(), rank);
        let mut laws = Vec::with_capacity(self.steps.len());
        let mut twice = 0.0;
        for (p, step) in self.steps.iter().enumerate() {
            let law = self.law(step.at, step.before, step.gap, &sds, times);
            twice += step.count * (TAU * law.sd[0] * law.sd[0] / law.w).ln();
            twice += law.quadratic(step.scatter);
            let ([a, b], root) = (law.weights(), step.count.sqrt());
            let [d, e] = self.residual(step, response);
            white.push(root * (a * d + b * e));
            let row = whitened.row_mut(p);
            add_scaled(row, root * a, self.factor.row(step.at));
            if let Some(before) = step.before {
                add_scaled(row, root * b, self.factor.row(before));
            }
            laws.push(law);
        }
        let mut capacitance = lacuna_linalg::gram(&whitened);
        for k in 0..rank {
            capacitance[(k, k)] += 1.0;
        }
        let capacitance = Cholesky::new(&capacitance).ok()?;
        let mut zeta = lacuna_linalg::transposed_multiply_vector(&whitened, &white);
        capacitance.solve(&mut zeta);
        for (x, row) in white.iter().zip(whitened.iter_rows()) {
            twice += (x - dot(row, &zeta)).powi(2);
        }
        twice += dot(&zeta, &zeta) + capacitance.log_determinant();
        Some(Solved { log_likelihood: -0.5 * twice, laws, zeta, capacitance })
    }

    /// Simulates the noise of all outputs of a replicate.
    fn noise_of(&self, sds: &[f64], times: &[f64], stream: &Stream) -> Vec<f64> {
        let mut rng = stream.generator();
        let mut noise = vec![0.0; sds.len()];
        for outputs in &self.series.outputs {
            let (mut last, mut u) = (f64::NEG_INFINITY, 0.0);
            for (&i, &t) in outputs.iter().zip(&self.series.grid) {
                let x = (t - last) / times[i];
                u = (-x).exp() * u + (-(-2.0 * x).exp_m1()).sqrt() * normal(&mut rng);
                last = t;
                noise[i] = sds[i] * u;
            }
        }
        noise
    }
}

impl Likelihood for AutoregressiveLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let solved = self.solve(response, hyper).map(|s| s.log_likelihood);
        solved.filter(|l| !l.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    fn is_cheap(&self) -> bool {
        self.factor.columns() == 0
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut by_hyper = vec![0.0; hyper.len()];
        let parts = self.solve(response, hyper).zip(self.time.values(hyper));
        let Some((solved, times)) = parts else { return (vec![0.0; response.len()], by_hyper) };
        let count = self.replicates.measured.len();
        let white = solved.capacitance.whiten_matrix(&self.factor.transposed()).transposed();
        let error: Vec<f64> = self.factor.iter_rows().map(|row| dot(row, &solved.zeta)).collect();
        let (mut by_mean, mut by_variance) = (vec![0.0; count], vec![0.0; count]);
        let mut by_time = vec![0.0; self.times.count()];
        for (step, law) in self.steps.iter().zip(&solved.laws) {
            let (k, n) = (step.at, step.count);
            let [a, b] = law.weights();
            let [mut d, mut e] = self.residual(step, response);
            d -= error[k];
            let [s, t, u] = step.scatter;
            let row = white.row(k);
            let at = s + n * (d * d + dot(row, row));
            let Some(j) = step.before else {
                by_mean[k] += n * a * a * d;
                by_variance[k] -= 0.5 * (n - at * a * a) * a * a;
                continue;
            };
            e -= error[j];
            let other = white.row(j);
            let both = t + n * (d * e + dot(row, other));
            let before = u + n * (e * e + dot(other, other));
            by_mean[k] += n * a * (a * d + b * e);
            by_mean[j] += n * b * (a * d + b * e);
            let (va, vb) = (law.sd[0] * law.sd[0], law.sd[1] * law.sd[1]);
            let cross = a * b * both;
            by_variance[k] -= 0.5 * (n - a * a * at - cross) / va;
            by_variance[j] += 0.5 * (cross + b * b * before) / vb;
            let (rho, w) = (law.rho, law.w);
            let quadratic = law.quadratic([at, both, before]);
            let own = -both / (law.sd[0] * law.sd[1]) + rho * before / vb;
            let by_rho = -0.5 * (2.0 * rho * w * (quadratic - n) + 2.0 * w * own);
            if let Some(g) = self.times.of[self.replicates.measured[k]] {
                by_time[g] += by_rho * rho * step.gap / (times[g] * times[g]);
            }
        }
        let by_group = self.noise.by_group(&self.replicates, &by_variance);
        self.noise.variance.add_gradient(&by_group, &mut by_hyper);
        self.time.add_gradient(&by_time, &mut by_hyper);
        (self.replicates.over_all(&by_mean, response.len()), by_hyper)
    }

    /// Computes the log density of each value given all others. The precision matrix of a replicate without common
    /// errors is tridiagonal along each series, so that each value interacts only with its two neighbours.
    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let solved = self.solve(response, hyper)?;
        let (sds, times) = (self.sds(hyper)?, self.time.values(hyper)?);
        let data = &self.noise.setting.data;
        let (outputs, rank) = (response.len(), self.factor.columns());
        let place = places(outputs, &self.replicates);
        let cells = outputs * data.replicates.len();
        // For each value: the precision times the residual, the diagonal of the precision, and the precision times
        // the common factor.
        let (mut pull, mut precision) = (vec![0.0; cells], vec![0.0; cells]);
        let mut rows = Matrix::zeros(cells, rank);
        // The outputs measured before and after each value.
        let mut neighbours = vec![[None, None]; cells];
        let left = |k: usize, y: f64| {
            y - response[self.replicates.measured[k]] - dot(self.factor.row(k), &solved.zeta)
        };
        for_each_step(data, &self.series, |r, (i, y), before, gap| {
            let k = place[i];
            let law = self.law(k, before.map(|(j, _)| place[j]), gap, &sds, times);
            let [a, b] = law.weights();
            let cell = r * outputs + i;
            let mut whitened: Vec<f64> = self.factor.row(k).iter().map(|f| a * f).collect();
            let mut residual = a * left(k, y);
            if let Some((j, x)) = before {
                residual += b * left(place[j], x);
                add_scaled(&mut whitened, b, self.factor.row(place[j]));
                neighbours[cell][0] = Some(j);
                let cell = r * outputs + j;
                neighbours[cell][1] = Some(i);
                pull[cell] += b * residual;
                precision[cell] += b * b;
                add_scaled(rows.row_mut(cell), b, &whitened);
            }
            pull[cell] += a * residual;
            precision[cell] += a * a;
            add_scaled(rows.row_mut(cell), a, &whitened);
        });
        // The variance explained by the common errors depends only on a value's neighbours, and is computed once for
        // each case.
        let mut explained: Vec<Vec<([Option<usize>; 2], f64)>> = vec![Vec::new(); outputs];
        let mut densities = Vec::new();
        for (r, replicate) in data.replicates.iter().enumerate() {
            for i in (0..outputs).filter(|&i| replicate.values[i].is_some()) {
                let cell = r * outputs + i;
                let found = explained[i].iter().find(|(own, _)| *own == neighbours[cell]);
                let known = found.map(|(_, share)| *share);
                let share = if let Some(share) = known {
                    share
                } else {
                    let share = solved.capacitance.quadratic(rows.row(cell));
                    explained[i].push((neighbours[cell], share));
                    share
                };
                densities.push(conditional(pull[cell], precision[cell] - share));
            }
        }
        Some(densities)
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let groups = self.noise.variance.values(hyper);
        let variance = groups.map(|g| self.noise.by_output(g));
        self.noise.setting.parts(&variance.unwrap_or_else(|| vec![f64::NAN; response.len()]))
    }

    /// Each part of the noise is a process with the correlation times of the whole, so that their sum is one as well.
    fn errors(&self, _: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let groups = self.noise.variance.values(hyper).unwrap_or_default();
        let times = self.times.spread(self.time.values(hyper).unwrap_or_default());
        self.noise.setting.errors_by(&self.noise.by_output(groups), stream, |part, stream| {
            let sds: Vec<f64> = part.variance.iter().map(|v| v.sqrt()).collect();
            let values = self.noise_of(&sds, &times, stream);
            ErrorPath { origin: part.origin.clone(), values }
        })
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let groups = self.noise.variance.values(hyper).unwrap_or_default();
        let sds: Vec<f64> = self.noise.by_output(groups).iter().map(|v| v.sqrt()).collect();
        let times = self.times.spread(self.time.values(hyper).unwrap_or_default());
        let mean = self.noise.setting.with_common_errors(response, stream);
        vec![self.noise.setting.replaced(stream, |own| {
            let noise = self.noise_of(&sds, &times, own);
            mean.iter().zip(noise).map(|(m, e)| m + e).collect()
        })]
    }

    fn facts(&self) -> Vec<Fact> {
        let count: f64 = self.replicates.count.iter().sum();
        vec![
            Fact::new("data", count),
            Fact::new("measured outputs", self.replicates.measured.len()),
            Fact::new("directions of the common errors", self.factor.columns()),
            Fact::new("correlated along", &self.series.axis),
        ]
    }
}

//! Likelihood of the data under a constrained bias.
//!
//! `c` are the functionals that are not negative, `d` the residuals of the means. With `V` the covariance of the means
//! and `K` that of `c` with them,
//!
//! ```text
//! log L = log N(d; 0, V) + log P(c >= 0 | d) - log P(c >= 0),
//! c | d ~ N(m + K V^-1 d, C - K V^-1 K').
//! ```

use lacuna::data::Measurements;
use lacuna::math::random::Stream;
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{ErrorPath, Hyperparameter, Known, Likelihood, VariancePart};
use lacuna::run::Stop;
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Matrix, multiply, multiply_transposed, multiply_vector};

use super::ConstrainedGaussianProcess;
use super::draws::constrained_draw;
use super::knowledge::Knowledge;
use super::orthant::{Orthant, gradient, log_probability};
use super::prior::{Joint, Prior};
use crate::discrepancies::common::{Block, Dense, DenseSolved, Noise, SmoothBias, part};

/// Likelihood with a constrained bias (see the module).
pub(super) struct ConstrainedLikelihood {
    noise: Noise,
    hyper: Vec<Hyperparameter>,
    pub(super) dense: Dense,
    pub(super) prior: Prior,
    /// Series with a measured output.
    active: Vec<usize>,
}

/// Distributions at one response and one set of hyperparameters.
struct State<'a> {
    values: (&'a [f64], &'a [f64]),
    variance: Vec<f64>,
    joints: Vec<Option<Joint>>,
    solved: DenseSolved,
    /// `V^-1 K'`.
    weights: Matrix,
    /// Mean and covariance of `c` given the data.
    mean: Vec<f64>,
    covariance: Matrix,
}

impl ConstrainedLikelihood {
    /// Builds the likelihood of `known.data`, with measured variances taken from the replicates of `shown`.
    pub fn under(
        options: &ConstrainedGaussianProcess,
        known: &Known<'_>,
        shown: &Measurements,
    ) -> Result<Self, Stop> {
        let smooth = options.smooth();
        let mut bias = smooth.unknowns(known, 0.3)?;
        let noise = smooth.noise(known, shown, &mut bias)?;
        let SmoothBias { replicates, series, groups, sd, length, hyper } = bias;
        let factor = replicates.common_factor(known.common)?;
        let dense = Dense::new(replicates, factor, known.data.layout.len());
        let blocks = Block::all(&series, &dense.place, &groups);
        let active = (0..blocks.len()).filter(|&s| !blocks[s].rows.is_empty()).collect();
        let knowledge = Knowledge::of(options, &series);
        let kernel = options.kernel;
        let prior = Prior { kernel, blocks, grid: series.grid, knowledge, sd, length };
        Ok(Self { noise, hyper, dense, prior, active })
    }

    fn state<'a>(&'a self, response: &[f64], hyper: &'a [f64]) -> Option<State<'a>> {
        let values = self.prior.values(hyper)?;
        let groups = self.noise.variance.values(hyper)?;
        let variance = self.noise.by_measured(&self.dense.replicates, groups);
        let joints = self.prior.measured(values)?;
        let mut residual = self.dense.replicates.residual(response);
        let (n, m) = (residual.len(), self.prior.conditions());
        let total = m * self.active.len();
        let (mut bias, mut cross) = (Matrix::zeros(n, n), Matrix::zeros(total, n));
        let (mut mean, mut covariance) = (vec![0.0; total], Matrix::zeros(total, total));
        for (p, &s) in self.active.iter().enumerate() {
            let joint = self.prior.of(&joints, s)?;
            let rows = &self.prior.blocks[s].rows;
            let k = rows.len();
            for (i, &row) in rows.iter().enumerate() {
                residual[row] -= joint.mean[i];
                rows.iter()
                    .enumerate()
                    .for_each(|(j, &c)| bias[(row, c)] = joint.covariance[(i, j)]);
                (0..m).for_each(|a| cross[(p * m + a, row)] = joint.covariance[(k + a, i)]);
            }
            for a in 0..m {
                mean[p * m + a] = joint.mean[k + a];
                for b in 0..m {
                    covariance[(p * m + a, p * m + b)] = joint.covariance[(k + a, k + b)];
                }
            }
        }
        let solved = self.dense.solve(&bias, &residual, &variance)?;
        let weights = solved.cholesky.solve_matrix(&cross.transposed());
        add_scaled(&mut mean, 1.0, &multiply_vector(&cross, &solved.pull));
        let taken = multiply(&cross, &weights);
        let entries = covariance.as_mut_slice().iter_mut().zip(taken.as_slice());
        entries.for_each(|(c, t)| *c -= t);
        Some(State { values, variance, joints, solved, weights, mean, covariance })
    }

    /// Returns for each group with data its first series and the number of its series.
    fn groups(&self) -> Vec<(usize, usize)> {
        let mut found: Vec<(usize, usize)> = Vec::new();
        for &s in &self.active {
            let group = self.prior.blocks[s].group;
            match found.iter_mut().find(|(first, _)| self.prior.blocks[*first].group == group) {
                Some((_, count)) => *count += 1,
                None => found.push((s, 1)),
            }
        }
        found
    }

    /// Returns the logarithm of the probability of the conditions before the data.
    fn before(&self, state: &State<'_>) -> Option<f64> {
        let one = |(first, count): (usize, usize)| {
            let joint = self.prior.of(&state.joints, first)?;
            let (mean, own) = joint.conditions(self.prior.blocks[first].rows.len());
            Some(count as f64 * log_probability(mean, &own)?)
        };
        self.groups().into_iter().map(one).sum()
    }

    fn try_log_likelihood(&self, response: &[f64], hyper: &[f64]) -> Option<f64> {
        let state = self.state(response, hyper)?;
        if state.mean.is_empty() {
            return Some(state.solved.log_likelihood);
        }
        let after = log_probability(&state.mean, &state.covariance)?;
        Some(state.solved.log_likelihood + after - self.before(&state)?)
    }

    /// Derivatives by the chain rule backwards through [`Self::state`].
    fn try_gradient(&self, response: &[f64], hyper: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let state = self.state(response, hyper)?;
        let after = if state.mean.is_empty() {
            Orthant { by_mean: Vec::new(), by_covariance: Matrix::zeros(0, 0) }
        } else {
            gradient(&state.mean, &state.covariance)?
        };
        // By V: those of the normal density, and through mean and covariance of `c`.
        let mut by_bias = state.solved.by_covariance();
        let along = multiply_vector(&state.weights, &after.by_mean);
        let inner = multiply(&state.weights, &after.by_covariance);
        let spread = multiply_transposed(&inner, &state.weights);
        let pull = &state.solved.pull;
        let n = pull.len();
        for i in 0..n {
            for j in 0..n {
                by_bias[(i, j)] += spread[(i, j)] - 0.5 * (along[i] * pull[j] + pull[i] * along[j]);
            }
        }
        // By K, `n x total`.
        let by_cross = Matrix::from_fn(n, after.by_mean.len(), |i, a| {
            pull[i] * after.by_mean[a] - 2.0 * inner[(i, a)]
        });
        // By the response: minus those by the residual.
        let by_response: Vec<f64> = (0..n).map(|i| pull[i] - along[i]).collect();
        let mut by_hyper = vec![0.0; hyper.len()];
        self.dense.add_by_noise(&self.noise, &state.variance, &by_bias, &mut by_hyper);
        self.add_by_process(&state, (&by_bias, &by_cross, &by_response), &after, &mut by_hyper)?;
        Some((self.dense.replicates.over_all(&by_response, response.len()), by_hyper))
    }

    /// Adds the derivatives with respect to standard deviations and correlation lengths.
    fn add_by_process(
        &self,
        state: &State<'_>,
        (by_bias, by_cross, by_mean): (&Matrix, &Matrix, &[f64]),
        after: &Orthant,
        by_hyper: &mut [f64],
    ) -> Option<()> {
        let m = self.prior.conditions();
        let groups = self.groups();
        let (mut by_sd, mut by_length) =
            (vec![0.0; state.values.0.len()], vec![0.0; state.values.0.len()]);
        for (p, &s) in self.active.iter().enumerate() {
            let block = &self.prior.blocks[s];
            let joint = self.prior.of(&state.joints, s)?;
            let k = block.rows.len();
            let mut by = Matrix::zeros(k + m, k + m);
            let mut by_own_mean = vec![0.0; k + m];
            for (i, &row) in block.rows.iter().enumerate() {
                by_own_mean[i] = by_mean[row];
                block.rows.iter().enumerate().for_each(|(j, &c)| by[(i, j)] = by_bias[(row, c)]);
                (0..m).for_each(|a| by[(k + a, i)] = by_cross[(row, p * m + a)]);
            }
            for a in 0..m {
                by_own_mean[k + a] = after.by_mean[p * m + a];
                (0..m).for_each(|b| {
                    by[(k + a, k + b)] = after.by_covariance[(p * m + a, p * m + b)];
                });
            }
            if let Some((_, count)) = groups.iter().find(|(first, _)| m > 0 && *first == s) {
                let (mean, own) = joint.conditions(k);
                let before = gradient(mean, &own)?;
                let count = *count as f64;
                for a in 0..m {
                    by_own_mean[k + a] -= count * before.by_mean[a];
                    (0..m).for_each(|b| {
                        by[(k + a, k + b)] -= count * before.by_covariance[(a, b)];
                    });
                }
            }
            let Some(g) = block.group else { continue };
            by_sd[g] += 2.0 * dot(by.as_slice(), joint.covariance.as_slice()) / state.values.0[g];
            by_length[g] += dot(by.as_slice(), joint.covariance_by_length.as_slice())
                + dot(&by_own_mean, &joint.mean_by_length);
        }
        self.prior.sd.add_gradient(&by_sd, by_hyper);
        self.prior.length.add_gradient(&by_length, by_hyper);
        Some(())
    }

    /// Logarithm of the probability of the conditions given all data but one value of the measured output `k`, with its
    /// entry of the precision matrix times the residuals and the diagonal entry.
    fn without(&self, state: &State<'_>, k: usize, pull: f64, precision: f64) -> Option<f64> {
        let share = 1.0 / self.dense.replicates.count[k];
        let w: Vec<f64> = state.weights.row(k).iter().map(|x| x * share).collect();
        let mean: Vec<f64> =
            state.mean.iter().zip(&w).map(|(m, w)| m - w * pull / precision).collect();
        let covariance = Matrix::from_fn(w.len(), w.len(), |i, j| {
            state.covariance[(i, j)] + w[i] * w[j] / precision
        });
        log_probability(&mean, &covariance)
    }
}

impl ConstrainedLikelihood {
    /// Draws the bias of all outputs given the data and the conditions of all series.
    fn draw_given_data(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<f64>> {
        let state = self.state(response, hyper)?;
        let (n, m, places) = (state.solved.pull.len(), self.prior.conditions(), response.len());
        let size = places + m * self.prior.blocks.len();
        let (mut mean, mut covariance) = (vec![0.0; size], Matrix::zeros(size, size));
        let mut cross = Matrix::zeros(size, n);
        for (s, block) in self.prior.blocks.iter().enumerate() {
            let values = block.of(state.values);
            let joint = self.prior.joint(&self.prior.grid, values)?;
            let conditions = (0..m).map(|a| places + s * m + a);
            let all: Vec<usize> = block.outputs.iter().copied().chain(conditions).collect();
            for (i, &a) in all.iter().enumerate() {
                mean[a] = joint.mean[i];
                for (j, &b) in all.iter().enumerate() {
                    covariance[(a, b)] = joint.covariance[(i, j)];
                    if b < places && self.dense.place[b] != usize::MAX {
                        cross[(a, self.dense.place[b])] = joint.covariance[(i, j)];
                    }
                }
            }
        }
        state.solved.condition(&cross, &mut mean, &mut covariance);
        constrained_draw(&mean, &covariance, places, stream)
    }
}

impl Likelihood for ConstrainedLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let value = self.try_log_likelihood(response, hyper);
        value.filter(|v| !v.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        self.try_gradient(response, hyper)
            .unwrap_or_else(|| (vec![0.0; response.len()], vec![0.0; hyper.len()]))
    }

    /// The quotient of the probabilities of the conditions with and without the value multiplies its normal density.
    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let state = self.state(response, hyper)?;
        let after = if state.mean.is_empty() {
            0.0
        } else {
            log_probability(&state.mean, &state.covariance)?
        };
        let correction = |k: usize, pull: f64, precision: f64| {
            if state.mean.is_empty() {
                return 0.0;
            }
            after - self.without(&state, k, pull, precision).unwrap_or(f64::NAN)
        };
        let data = &self.noise.setting.data;
        Some(self.dense.left_out(&state.solved, data, &state.variance, correction))
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let unknown = || vec![f64::NAN; response.len()];
        let noise = self.noise.variance.values(hyper).map(|g| self.noise.by_output(g));
        let bias = self.prior.mean_squares(hyper, response.len());
        let mut parts = vec![
            part("measurement", noise.unwrap_or_else(unknown)),
            part("model_form", bias.unwrap_or_else(unknown)),
        ];
        parts.extend(self.noise.setting.common_parts());
        parts
    }

    /// The bias is drawn from its prior: that of other conditions than those measured.
    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let noise = self.noise.by_output(self.noise.variance.values(hyper).unwrap_or_default());
        let noise = part("measurement", noise).independent(&stream.at(0));
        let bias = self.prior.draw(hyper, response.len(), &stream.at(1));
        let values = bias.unwrap_or_else(|| vec![f64::NAN; response.len()]);
        let own = [noise, ErrorPath { origin: "model_form".into(), values }];
        own.into_iter().chain(self.noise.setting.drawn_common_errors(stream)).collect()
    }

    fn errors_given_data(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<ErrorPath>> {
        let bias = self.draw_given_data(response, hyper, &stream.at(1))?;
        let mut paths = self.errors(response, hyper, stream);
        paths[1].values = bias;
        Some(paths)
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let setting = &self.noise.setting;
        let mut mean = setting.with_common_errors(response, stream);
        let bias = self.prior.draw(hyper, response.len(), &stream.named("bias"));
        mean.iter_mut().zip(bias.unwrap_or_default()).for_each(|(m, b)| *m += b);
        let noise = self.noise.by_output(self.noise.variance.values(hyper).unwrap_or_default());
        vec![setting.noisy(&mean, &noise, stream)]
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("data", self.dense.replicates.count.iter().sum::<f64>()),
            Fact::new("measured outputs", self.dense.replicates.measured.len()),
            Fact::new("series with a bias", self.prior.blocks.len()),
            Fact::new("known values and slopes per series", self.prior.knowledge.fixed.len()),
            Fact::new("conditions on sign and direction per series", self.prior.conditions()),
            Fact::new("directions of the common errors", self.dense.factor.columns()),
        ]
    }
}

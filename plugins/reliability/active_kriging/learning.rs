//! The loop of active learning.

use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::math::special::normal_quantile;
use lacuna::plugin::reliability::{Estimate, LimitState};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::norm;

use super::ActiveKriging;
use super::choice::Predicted;
use super::process::Process;
use crate::reliability::common::{Counted, log_normal, normals};
use crate::reliability::subset_simulation::{Outcome, Settings, Simulated, simulate};

/// Calls of the model and the processes fitted to them.
pub struct Learning<'a> {
    options: &'a ActiveKriging,
    state: &'a dyn LimitState,
    counted: &'a Counted<'a>,
    stream: &'a Stream,
    points: Matrix,
    values: Vec<f64>,
}

/// Spread of the first calls, in standard deviations of the variables.
const SPREAD: f64 = 1.5;
/// Level probability and number of levels of the simulations: down to 1e-12.
const SHARE: f64 = 0.1;
const LEVELS: usize = 13;
/// Repetitions of the final simulation.
const REPEATS: u64 = 4;
/// Two-sided 95 % of a normal distribution.
const TWO_SIDED: f64 = 1.959_963_984_540_054;
/// Candidates for a check, and their distance beyond that of the probability.
const REMOTE: usize = 500;
const BEYOND: f64 = 0.5;

impl<'a> Learning<'a> {
    /// Learning before the first call.
    pub fn new(
        options: &'a ActiveKriging,
        state: &'a dyn LimitState,
        counted: &'a Counted<'a>,
        stream: &'a Stream,
    ) -> Self {
        let points = Matrix::zeros(0, state.dimension());
        Self { options, state, counted, stream, points, values: Vec::new() }
    }

    /// Calls the model until the criteria are met.
    pub fn run(mut self) -> Result<Estimate, Stop> {
        let d = self.state.dimension();
        let count = self.options.initial.unwrap_or((2 * d + 2).max(6)).min(self.options.calls);
        self.call(&self.first(count))?;
        let wanted = self.options.checks.unwrap_or((2 * d).clamp(4, 10));
        let (mut passed, mut before, mut round) = (0, f64::NAN, 0);
        while passed < wanted && self.counted.calls() < self.options.calls {
            let random = self.stream.named("round").at(round);
            round += 1;
            let process = self.fitted(&random)?;
            let (outcome, predicted) = self.predicted(&process, self.options.samples, &random)?;
            let now = predicted.probability(0.0);
            let doubt: f64 = predicted.doubts().iter().sum();
            let steady = (now - before).abs() <= 0.5 * now.max(before) || passed > 0;
            let sure = outcome.reached && doubt <= self.options.precision * now;
            before = now;
            let left = self.options.calls - self.counted.calls();
            let batch = self.options.batch.min(left);
            let next = predicted.choose(&process, batch, &random.named("choice"));
            if (sure && steady) || next.rows() == 0 {
                let check = self.remote(&predicted, now, &random.named("check"));
                passed = if self.confirmed(&process, &check)? { passed + 1 } else { 0 };
            } else {
                passed = 0;
                self.call(&next)?;
            }
        }
        self.estimate(passed >= wanted)
    }

    /// The point farthest from all calls among those that would matter if they failed: on the sphere just beyond the distance
    /// that belongs to the probability; among the samples of a posterior.
    fn remote(&self, predicted: &Predicted, probability: f64, random: &Stream) -> Vec<f64> {
        let candidates = if self.state.draws().is_some() {
            let count = predicted.points.rows();
            let mut rows = permutation(&mut random.generator(), count);
            rows.truncate(REMOTE);
            predicted.points.select_rows(&rows)
        } else {
            let radius = (-normal_quantile(probability.clamp(1e-12, 0.3))).max(1.0) + BEYOND;
            let mut points = normals(REMOTE, self.state.dimension(), &mut random.generator());
            for i in 0..REMOTE {
                let factor = radius / norm(points.row(i)).max(1e-12);
                points.row_mut(i).iter_mut().for_each(|x| *x *= factor);
            }
            points
        };
        let nearest = |u: &[f64]| {
            let square = |v: &[f64]| u.iter().zip(v).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            self.points.iter_rows().map(square).fold(f64::INFINITY, f64::min)
        };
        let distances: Vec<f64> = candidates.iter_rows().map(nearest).collect();
        let best = (0..distances.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        candidates.row(best.unwrap_or(0)).to_vec()
    }

    /// Calls the model at a point; true if the process had the sign of the value.
    fn confirmed(&mut self, process: &Process, point: &[f64]) -> Result<bool, Stop> {
        let point = Matrix::from_vec(1, point.len(), point.to_vec());
        let mean = process.mean(&point)[0];
        let before = self.values.len();
        self.call(&point)?;
        let value = self.values.get(before).copied();
        Ok(value.is_none_or(|value| (value <= 0.0) == (mean <= 0.0)))
    }

    /// Latin hypercube of normal variables with a larger spread, and the origin.
    fn first(&self, count: usize) -> Matrix {
        if let Some(draws) = self.state.draws() {
            let mut rows = permutation(&mut self.stream.named("first").generator(), draws.rows());
            rows.truncate(count);
            return draws.select_rows(&rows);
        }
        let mut rng = self.stream.named("first").generator();
        let others = count - 1;
        let mut points = Matrix::zeros(count, self.state.dimension());
        for j in 0..points.columns() {
            for (i, cell) in permutation(&mut rng, others).into_iter().enumerate() {
                let p = (cell as f64 + uniform(&mut rng)) / others as f64;
                points[(i + 1, j)] = SPREAD * normal_quantile(p);
            }
        }
        points
    }

    fn call(&mut self, points: &Matrix) -> Result<(), Stop> {
        let values = self.counted.values(points)?;
        for (point, value) in points.iter_rows().zip(values) {
            if value.is_finite() {
                self.points.push_row(point);
                self.values.push(value);
            }
        }
        Ok(())
    }

    fn fitted(&self, random: &Stream) -> Result<Process, Stop> {
        let stream = random.named("fit");
        let found = Process::fit(self.options.kernel, &self.points, &self.values, &stream);
        found.ok_or_else(|| {
            let message =
                "no Gaussian process fits the limit state: its values are all equal, or too few";
            Stop::new(message)
                .help("use `subset_simulation`, or a larger number of `initial` calls")
        })
    }

    /// Subset simulation with the mean of the process, and the predictions at its samples.
    fn predicted(
        &self,
        process: &Process,
        samples: usize,
        random: &Stream,
    ) -> Result<(Outcome, Predicted), Stop> {
        let values = |points: &Matrix| Ok(process.mean(points));
        let log_weights = |points: &Matrix| self.state.log_weights(points);
        let problem = Simulated {
            dimension: self.state.dimension(),
            values: &values,
            log_weights: (!self.state.is_standard_normal()).then_some(&log_weights),
            draws: self.state.draws(),
        };
        let settings = Settings { samples, share: SHARE, levels: LEVELS };
        let outcome = simulate(&problem, settings, &random.named("subsets"))?;
        let (points, weights) = outcome.weighted();
        Ok((outcome, Predicted::new(process, points, weights)))
    }

    fn estimate(&self, converged: bool) -> Result<Estimate, Stop> {
        let random = self.stream.named("final");
        let process = self.fitted(&random)?;
        let repeats = (0..REPEATS).map(|i| {
            let samples = self.options.final_samples / REPEATS as usize;
            self.predicted(&process, samples, &random.at(i))
        });
        let all = repeats.collect::<Result<Vec<_>, _>>()?;
        let over = |each: &dyn Fn(&(Outcome, Predicted)) -> f64| {
            all.iter().map(each).sum::<f64>() / REPEATS as f64
        };
        let probability = over(&|(outcome, _)| outcome.probability);
        let reached = all.iter().all(|(outcome, _)| outcome.reached);
        // Repetitions know the correlation between levels, which that of one simulation does not contain.
        let claimed = over(&|(outcome, _)| outcome.variation) / (REPEATS as f64).sqrt();
        let scatter = over(&|(outcome, _)| (outcome.probability - probability).powi(2));
        let observed = (scatter / (REPEATS as f64 - 1.0)).sqrt() / probability;
        let sampling = claimed.max(observed);
        let doubt = over(&|(_, predicted)| predicted.doubts().iter().sum());
        let mut warnings: Vec<String> = self.counted.warning().into_iter().collect();
        if !reached {
            warnings
                .push("the Gaussian process has no failure region within its levels".to_owned());
        } else if !converged {
            let share = 100.0 * doubt / probability;
            warnings.push(format!(
                "the calls end before the sign of the process is sure: its expected error is {share:.1} % of the probability"
            ));
        }
        let usable = reached && probability > 0.0;
        let variation = sampling.hypot(doubt / probability);
        let interval = usable.then(|| {
            let [low, high] = [TWO_SIDED, -TWO_SIDED].map(|s| over(&|(_, p)| p.probability(s)));
            let [low, high] = [low.min(probability), high.max(probability)];
            [log_normal(low, sampling)[0], log_normal(high, sampling)[1]]
        });
        Ok(Estimate {
            probability,
            variation: usable.then_some(variation),
            interval,
            calls: self.counted.calls(),
            undefined: self.counted.undefined(),
            failures: Some(self.counted.failures()),
            design_points: Vec::new(),
            converged: converged && reached,
            warnings,
        })
    }
}

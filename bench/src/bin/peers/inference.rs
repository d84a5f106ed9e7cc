//! Sampling from the posterior, and estimation of its evidence.

use std::path::Path;

use lacuna::data::{Draws, Measurements, Parameter};
use lacuna::diagnose::Diagnosis;
use lacuna::math::distribution::Distribution;
use lacuna::math::moments::{mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{Discrepancy, Known};
use lacuna::plugin::sampler::{Evidence, Sampler};
use lacuna::plugin::{Emulator, Target};
use lacuna_bench::clock::{per_call, timed};
use lacuna_engine::posterior::bridge::bridge;
use lacuna_engine::posterior::{OfData, Posterior};
use lacuna_linalg::Matrix;
use lacuna_plugins::discrepancies::common::By;
use lacuna_plugins::discrepancies::gaussian::Gaussian;
use lacuna_plugins::samplers::affine_invariant_ensemble::AffineInvariantEnsemble;
use lacuna_plugins::samplers::sequential_monte_carlo::SequentialMonteCarlo;
use serde_json::{Value, json};

use crate::Fallible;
use crate::problem::{self, VARIANCE_SCALE};
use crate::surrogates::{ADAPTIVE, SMALL, emulator};

/// Number of repeated estimates of the evidence, which show its scatter.
const SEEDS: u64 = 8;

/// Parts of a posterior.
struct Parts {
    parameters: Vec<Parameter>,
    data: Measurements,
    emulator: Box<dyn Emulator>,
}

impl Parts {
    fn read(folder: &Path, name: &str) -> Fallible<Self> {
        let data = problem::measurements(folder)?;
        Ok(Self { parameters: problem::parameters()?, data, emulator: emulator(folder, name)? })
    }

    /// Calls `job` with the posterior and the time it took to prepare.
    fn with_posterior<T>(
        &self,
        job: impl FnOnce(&Posterior<'_>, f64) -> Fallible<T>,
    ) -> Fallible<T> {
        let gaussian = Gaussian {
            variance: Distribution::HalfNormal(VARIANCE_SCALE).into(),
            by: By::default(),
            marginal: false,
        };
        let known = Known::without_slopes(&self.data, &[]);
        let (likelihood, statistics) = timed(|| gaussian.likelihood(&known))?;
        let likelihood = likelihood?;
        let join = || OfData::new(&*self.emulator, Vec::new(), &*likelihood);
        let (emulated, reduction) = timed(join)?;
        job(&Posterior::new(&self.parameters, emulated), statistics + reduction)
    }
}

/// The ensemble sampler with both emulators.
pub fn ensemble(folder: &Path) -> Fallible<Value> {
    Ok(json!({ ADAPTIVE: ensemble_of(folder, ADAPTIVE)?, SMALL: ensemble_of(folder, SMALL)? }))
}

/// The ensemble sampler for its usual number of steps, starting around the best fit.
fn ensemble_of(folder: &Path, name: &str) -> Fallible<Value> {
    Parts::read(folder, name)?.with_posterior(|posterior, preparation| {
        let sampler = AffineInvariantEnsemble::default();
        let starts = starts(posterior, sampler.walkers)?;
        problem::save(folder, &format!("{name}_start"), &starts)?;
        let densities = Matrix::from_vec(1, starts.rows(), posterior.log_density(&starts));
        problem::save(folder, &format!("{name}_start_log_density"), &densities)?;
        let half: Vec<usize> = (0..sampler.walkers / 2).collect();
        let half = starts.select_rows(&half);
        let evaluation = per_call(|| drop(posterior.log_density(&half)))? / half.rows() as f64;
        let (steps, seconds) = timed(|| walk(&sampler, posterior, starts))?;
        let draws = Draws::from_steps(vec![String::new(); posterior.dimension()], &steps?);
        let draws = draws.from_step(sampler.steps / 2);
        let judged = Diagnosis::of(&draws, true).coordinates;
        let coordinates: Vec<Vec<f64>> = (0..draws.dimension())
            .map(|j| draws.coordinate(j).collect::<Vec<_>>().concat())
            .collect();
        Ok(json!({
            "cpu_seconds": seconds,
            "cpu_seconds_of_preparation": preparation,
            "cpu_seconds_of_an_evaluation": evaluation,
            "evaluations": sampler.walkers * (sampler.steps + 1),
            "mean": coordinates.iter().map(|x| mean(x)).collect::<Vec<_>>(),
            "sd": coordinates.iter().map(|x| variance(x).sqrt()).collect::<Vec<_>>(),
            "autocorrelation_time":
                judged.iter().map(|c| c.autocorrelation_time).collect::<Vec<_>>(),
        }))
    })
}

/// Runs all steps.
fn walk(
    sampler: &dyn Sampler,
    target: &dyn Target,
    starts: Matrix,
) -> Fallible<Vec<(Matrix, Vec<f64>)>> {
    let stream = Stream::root(6);
    let mut state = sampler.start(target, starts)?;
    let mut steps = Vec::new();
    for step in 0..sampler.plan(target.dimension()).steps {
        sampler.step(target, &mut state, &stream.at(step as u64))?;
        steps.push((state.points.clone(), state.log_density.clone()));
    }
    Ok(steps)
}

/// Points around the best of several maxima.
fn starts(posterior: &Posterior<'_>, count: usize) -> Fallible<Matrix> {
    let random = Stream::root(5);
    let candidates = posterior.prior_draws(400, &random.named("candidates"));
    let density = posterior.log_density(&candidates);
    let mut order: Vec<usize> = (0..candidates.rows()).collect();
    order.sort_by(|&a, &b| density[b].total_cmp(&density[a]));
    let maxima = lacuna_optimise::maximise(posterior, &candidates.select_rows(&order[..12]));
    let best = maxima.first().ok_or("no maximum of the posterior was found")?;
    let laplace = lacuna_optimise::laplace(posterior, &best.point)?;
    Ok(lacuna_optimise::scatter(posterior, &best.point, &laplace, count, &random.named("scatter"))?)
}

/// The evidence by sequential Monte Carlo, several times, and by bridge sampling; with the smaller emulator, which
/// saves the other program most of its time.
pub fn evidence(folder: &Path) -> Fallible<Value> {
    Parts::read(folder, SMALL)?.with_posterior(|posterior, preparation| {
        let sampler = SequentialMonteCarlo::default();
        let (mut logs, mut errors, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
        let mut evaluations = Vec::new();
        for seed in 0..SEEDS {
            let stream = Stream::root(100 + seed);
            let (found, time) = timed(|| cool(&sampler, posterior, &stream))?;
            let (evidence, count) = found?;
            logs.push(evidence.log);
            errors.push(evidence.error);
            seconds.push(time);
            evaluations.push(count);
        }
        let reference = bridged(posterior)?;
        let squares: Vec<f64> = logs.iter().map(|log| (log - reference.log).powi(2)).collect();
        Ok(json!({
            "cpu_seconds": mean(&seconds),
            "cpu_seconds_of_preparation": preparation,
            "log_evidence": mean(&logs),
            "error": mean(&errors),
            "error_seen": mean(&squares).sqrt(),
            "runs": logs,
            "evaluations": evaluations,
            "particles": sampler.particles,
            "bridge_log_evidence": reference.log,
            "bridge_error": reference.error,
        }))
    })
}

/// Evidence from one population, and the number of evaluations.
fn cool(
    sampler: &SequentialMonteCarlo,
    target: &dyn Target,
    stream: &Stream,
) -> Fallible<(Evidence, u64)> {
    let plan = sampler.plan(target.dimension());
    let starts = target.prior_draws(plan.chains, &stream.named("start"));
    let mut state = sampler.start(target, starts)?;
    for step in 0..plan.steps {
        if sampler.finished(&state) {
            break;
        }
        sampler.step(target, &mut state, &stream.at(step as u64))?;
    }
    let harvest = sampler.harvest(target, &state, &stream.named("harvest"))?;
    let evidence = harvest.and_then(|h| h.evidence).ok_or("no evidence was found")?;
    Ok((evidence, state.evaluations))
}

/// Evidence from draws of the ensemble.
fn bridged(posterior: &Posterior<'_>) -> Fallible<Evidence> {
    let sampler = AffineInvariantEnsemble::default();
    let steps = walk(&sampler, posterior, starts(posterior, sampler.walkers)?)?;
    let draws = Draws::from_steps(vec![String::new(); posterior.dimension()], &steps);
    Ok(bridge(posterior, &draws.from_step(sampler.steps / 2), &Stream::root(7))?)
}

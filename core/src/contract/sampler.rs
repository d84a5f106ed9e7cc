//! The contract of samplers.

use crate::data::Draws;
use crate::diagnose::{autocorrelation, chains};
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::math::moments::{mean, variance};
use crate::math::random::{Stream, uniform};
use crate::plugin::sampler::{Sampler, State, Target};

/// One clause of the contract; an error says how it was broken.
type Check = fn(&dyn Sampler) -> Result<(), String>;

/// Puts a sampler through the contract.
///
/// - `start` and `step` keep one finite point a chain, inside the support, with the log density of
///   that very point;
/// - a state written and read again continues with the same bits;
/// - the number of threads changes nothing;
/// - starting points outside the support, of the wrong number or not finite are refused;
/// - the mean and the standard deviation of a normal law in two correlated coordinates come out
///   within four Monte Carlo errors.
pub fn sampler(name: &str, sampler: &dyn Sampler) -> Result<(), Vec<String>> {
    let checks: [(&str, Check); 5] = [
        ("keeps sound states", keeps_sound_states),
        ("continues from a saved state", continues_from_a_saved_state),
        ("does not depend on threads", does_not_depend_on_threads),
        ("refuses bad starting points", refuses_bad_starts),
        ("draws a normal law", draws_a_normal_law),
    ];
    let breaches: Vec<String> = checks
        .iter()
        .filter_map(|(what, check)| {
            check(sampler).err().map(|breach| format!("sampler `{name}`, {what}: {breach}"))
        })
        .collect();
    if breaches.is_empty() { Ok(()) } else { Err(breaches) }
}

/// A normal law in two correlated coordinates of different scale.
struct Normal;

const MEAN: [f64; 2] = [1.0, -200.0];
const SD: [f64; 2] = [0.5, 30.0];
const CORRELATION: f64 = 0.6;

impl Target for Normal {
    fn dimension(&self) -> usize {
        2
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.gradient(point).0).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let laws = || MEAN.into_iter().zip(SD).map(|(mean, sd)| Distribution::Normal([mean, sd]));
        points
            .iter_rows()
            .map(|p| laws().zip(p).map(|(law, &x)| law.log_density(x)).sum())
            .collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (u, v) = ((point[0] - MEAN[0]) / SD[0], (point[1] - MEAN[1]) / SD[1]);
        let rest = 1.0 - CORRELATION * CORRELATION;
        let slope = [(u - CORRELATION * v) / rest, (v - CORRELATION * u) / rest];
        (-0.5 * (u * slope[0] + v * slope[1]), vec![-slope[0] / SD[0], -slope[1] / SD[1]])
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); 2]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, 2, |_, j| Distribution::Normal([MEAN[j], SD[j]]).sample(&mut rng))
    }
}

/// An exponential law beside a uniform one, with zero density outside `[0, inf) x [0, 1]`.
struct Bounded;

impl Target for Bounded {
    fn dimension(&self) -> usize {
        2
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.gradient(point).0).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        self.log_density(points)
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        if point[0] >= 0.0 && (0.0..=1.0).contains(&point[1]) {
            (-point[0], vec![-1.0, 0.0])
        } else {
            (f64::NEG_INFINITY, vec![0.0, 0.0])
        }
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(0.0, f64::INFINITY), (0.0, 1.0)]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(
            count,
            2,
            |_, j| {
                if j == 0 { -uniform(&mut rng).ln() } else { uniform(&mut rng) }
            },
        )
    }
}

fn begin(sampler: &dyn Sampler, target: &dyn Target) -> Result<State, String> {
    let count = sampler.plan(target.dimension()).chains;
    let points = target.prior_draws(count, &Stream::root(1).named("start"));
    sampler.start(target, points).map_err(|stop| format!("draws of the prior are refused: {stop}"))
}

fn advance(
    sampler: &dyn Sampler,
    target: &dyn Target,
    state: &mut State,
    steps: std::ops::Range<u64>,
) -> Result<(), String> {
    let stream = Stream::root(1).named("step");
    for step in steps {
        sampler
            .step(target, state, &stream.at(step))
            .map_err(|stop| format!("step {step} stops: {stop}"))?;
    }
    Ok(())
}

fn keeps_sound_states(sampler: &dyn Sampler) -> Result<(), String> {
    let chains = sampler.plan(2).chains;
    let mut state = begin(sampler, &Bounded)?;
    for step in 0..50 {
        if step > 0 {
            advance(sampler, &Bounded, &mut state, step - 1..step)?;
        }
        let shape = (state.points.rows(), state.points.columns());
        if shape != (chains, 2)
            || state.log_density.len() != chains
            || state.accepted.len() != chains
        {
            return Err(format!("after {step} steps the state has not one entry a chain"));
        }
        let inside = |p: &[f64]| p[0] >= 0.0 && p[0].is_finite() && (0.0..=1.0).contains(&p[1]);
        if let Some(point) = state.points.iter_rows().find(|point| !inside(point)) {
            return Err(format!("after {step} steps a chain is outside the support at {point:?}"));
        }
        if state.log_density != Bounded.log_density(&state.points) {
            return Err(format!("after {step} steps a log density is not that of its point"));
        }
    }
    if state.evaluations == 0 {
        return Err("evaluations are not counted".into());
    }
    Ok(())
}

fn continues_from_a_saved_state(sampler: &dyn Sampler) -> Result<(), String> {
    let mut state = begin(sampler, &Normal)?;
    advance(sampler, &Normal, &mut state, 0..7)?;
    let saved = serde_json::to_string(&state).map_err(|e| format!("cannot be written: {e}"))?;
    let mut read: State =
        serde_json::from_str(&saved).map_err(|e| format!("cannot be read again: {e}"))?;
    advance(sampler, &Normal, &mut state, 7..20)?;
    advance(sampler, &Normal, &mut read, 7..20)?;
    if state == read { Ok(()) } else { Err("the continued chain is another one".into()) }
}

fn does_not_depend_on_threads(sampler: &dyn Sampler) -> Result<(), String> {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| format!("no pool of {threads} threads: {error}"))?;
        pool.install(|| {
            let mut state = begin(sampler, &Normal)?;
            advance(sampler, &Normal, &mut state, 0..20)?;
            Ok::<State, String>(state)
        })
    };
    if run(1)? == run(3)? { Ok(()) } else { Err("one and three threads differ".into()) }
}

fn refuses_bad_starts(sampler: &dyn Sampler) -> Result<(), String> {
    let chains = sampler.plan(2).chains;
    let good = Bounded.prior_draws(chains, &Stream::root(1).named("start"));
    let with = |value: f64| {
        let mut points = good.clone();
        points[(chains / 2, 1)] = value;
        points
    };
    let short = good.select_rows(&(1..chains).collect::<Vec<_>>());
    for (what, points) in [
        ("a point outside the support", with(1.5)),
        ("a point that is not a number", with(f64::NAN)),
        ("one point too few", short),
    ] {
        if sampler.start(&Bounded, points).is_ok() {
            return Err(format!("{what} is accepted"));
        }
    }
    Ok(())
}

fn draws_a_normal_law(sampler: &dyn Sampler) -> Result<(), String> {
    let plan = sampler.plan(2);
    // Long enough for a sharp test, short enough for every test run.
    let steps = plan.steps.clamp(1000, 4000) as u64;
    let mut state = begin(sampler, &Normal)?;
    advance(sampler, &Normal, &mut state, 0..steps / 4)?;
    let mut kept = Vec::new();
    for step in steps / 4..steps {
        advance(sampler, &Normal, &mut state, step..step + 1)?;
        kept.push((state.points.clone(), state.log_density.clone()));
    }
    let draws = Draws::from_steps(vec!["x".into(), "y".into()], &kept);
    let error = |values: &[Vec<f64>]| {
        if plan.ensemble {
            autocorrelation::ensemble_error(values)
        } else {
            chains::mcse_mean(values)
        }
    };
    for j in 0..2 {
        let values: Vec<Vec<f64>> = draws.coordinate(j).collect();
        let squares: Vec<Vec<f64>> =
            values.iter().map(|c| c.iter().map(|x| (x - MEAN[j]).powi(2)).collect()).collect();
        let pooled = draws.pooled(j);
        let (found_mean, found_sd) = (mean(&pooled), variance(&pooled).sqrt());
        // The delta method turns the error of the variance into that of its root.
        let (of_mean, of_sd) = (error(&values), error(&squares) / (2.0 * SD[j]));
        for (what, found, expected, error) in
            [("mean", found_mean, MEAN[j], of_mean), ("sd", found_sd, SD[j], of_sd)]
        {
            if error.is_nan() || (found - expected).abs() > 4.0 * error {
                return Err(format!(
                    "the {what} of coordinate {} is {found} and not {expected}, \
                     with a Monte Carlo error of {error}",
                    j + 1
                ));
            }
            if error > 0.1 * SD[j] {
                return Err(format!(
                    "after {steps} steps the {what} of coordinate {} is known to {error} only",
                    j + 1
                ));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;

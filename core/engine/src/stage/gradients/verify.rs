//! Comparison of the model's derivatives with differences, before it is asked for all of them.
//!
//! A derivative of the wrong sign, or by another unit, spoils the fit without any sign of it. So the derivatives at one
//! run are compared with the difference of two further runs on both sides of it, along a random direction in which all
//! parameters change. Only if they disagree are further runs made, two for each parameter until the wrong one is found.

use lacuna::data::Parameter;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::model::EvalError;
use lacuna::run::{Observer, Stop};
use lacuna_linalg::{Matrix, vector};

use super::{Asked, Unknown};
use crate::stage::simulator::Setting;
use crate::stage::stream;

/// Size of the steps in the central 95 % of the designs: the error of the formula is about the square of it.
const STEP: f64 = 1e-3;
/// Largest difference that is accepted, as a share of the change of the response: inexact adjoint solvers are common.
const ACCEPTED: f64 = 0.05;
/// Change of the response that is taken for noise of the model, as a share of the response.
const NOISE: f64 = 1e-8;

/// The run at which the derivatives are compared, and the steps.
pub(super) struct Verification<'a> {
    asked: &'a Asked<'a>,
    /// Name of the run.
    name: &'a str,
    point: &'a [f64],
    /// Step of each parameter, in its unit.
    steps: Vec<f64>,
}

/// A change of the response along a step: by the model's derivatives, and by the difference of two runs.
struct Change {
    stated: Vec<f64>,
    found: Vec<f64>,
    /// Size below which a change is noise.
    noise: f64,
}

impl Change {
    /// Size of the difference as a share of the change; zero for changes that are noise.
    fn share(&self) -> f64 {
        let apart: Vec<f64> = self.stated.iter().zip(&self.found).map(|(a, b)| a - b).collect();
        let (apart, size) =
            (vector::norm(&apart), vector::norm(&self.stated).max(vector::norm(&self.found)));
        if apart <= self.noise { 0.0 } else { apart / size }
    }

    /// The output at which the difference is largest.
    fn worst(&self) -> usize {
        let apart = |o: usize| (self.stated[o] - self.found[o]).abs();
        (0..self.stated.len()).fold(0, |worst, o| if apart(o) > apart(worst) { o } else { worst })
    }
}

impl<'a> Verification<'a> {
    /// Chooses the run in the middle of the design, and the direction.
    pub fn of(
        asked: &'a Asked<'a>,
        parameters: &[Parameter],
        names: &'a [String],
        points: &'a Matrix,
    ) -> Self {
        let depth = |i: usize| {
            let tails = parameters.iter().zip(points.row(i)).map(|(p, &x)| {
                let below = p.design.cdf(x);
                below.min(1.0 - below)
            });
            tails.fold(f64::INFINITY, f64::min)
        };
        let middle =
            (0..points.rows()).fold(0, |best, i| if depth(i) > depth(best) { i } else { best });
        let point = points.row(middle);
        let direction: Stream = stream(asked.study, "gradients");
        let mut rng = direction.generator();
        let step = |(parameter, &x): (&Parameter, &f64)| {
            let design = &parameter.design;
            let width = design.quantile(0.975) - design.quantile(0.025);
            let (low, high) = design.support();
            // Half of the way to the next bound, at most.
            let room = 0.5 * (x - low).min(high - x).max(0.0);
            let sign = if uniform(&mut rng) < 0.5 { -1.0 } else { 1.0 };
            sign * (STEP * width * (0.5 + uniform(&mut rng))).min(room)
        };
        let steps = parameters.iter().zip(point).map(step).collect();
        Self { asked, name: &names[middle], point, steps }
    }

    /// Compares, and stops at a wrong derivative. If the model cannot be run there, it is said that nothing was compared.
    pub fn run(&self, observer: &dyn Observer) -> Result<(), Stop> {
        for (place, setting) in self.asked.simulator.settings.iter().enumerate() {
            let slopes = match self.asked.under(place, setting, self.point) {
                Ok(slopes) => slopes,
                Err(Unknown::Everywhere(stop)) => return Err(stop),
                Err(Unknown::Here(reason)) => {
                    observer.warn(&self.not_compared(&reason));
                    return Ok(());
                }
            };
            match self.along(setting, &slopes, &self.steps) {
                Ok(change) if change.share() > ACCEPTED => {
                    return Err(self.wrong(setting, &slopes, &change));
                }
                Ok(_) => {}
                Err(EvalError::Fatal(reason)) => return Err(Stop::new(reason)),
                Err(EvalError::Rejected(reason)) => observer.warn(&self.not_compared(&reason)),
            }
        }
        Ok(())
    }

    fn not_compared(&self, reason: &str) -> String {
        format!("the derivatives of run {} were not compared with differences: {reason}", self.name)
    }

    /// Change of the response under one scenario along a step.
    fn along(
        &self,
        setting: &Setting<'_>,
        slopes: &[f64],
        steps: &[f64],
    ) -> Result<Change, EvalError> {
        let at = |side: f64| {
            let moved: Vec<f64> =
                self.point.iter().zip(steps).map(|(x, step)| x + side * step).collect();
            self.asked.simulator.respond_to(setting, &moved)
        };
        let (above, below) = (at(1.0)?.values, at(-1.0)?.values);
        Ok(Change {
            stated: slopes.chunks_exact(steps.len()).map(|own| vector::dot(own, steps)).collect(),
            found: above.iter().zip(&below).map(|(a, b)| 0.5 * (a - b)).collect(),
            noise: NOISE * vector::norm(&above),
        })
    }

    /// The error with the parameter whose derivative is wrong.
    fn wrong(&self, setting: &Setting<'_>, slopes: &[f64], all: &Change) -> Stop {
        for (j, &step) in self.steps.iter().enumerate() {
            let mut steps = vec![0.0; self.steps.len()];
            steps[j] = step;
            let Ok(change) = self.along(setting, slopes, &steps) else { continue };
            if change.share() > ACCEPTED {
                let name = &self.asked.simulator.unknowns[j];
                let o = change.worst();
                let [stated, found] = [change.stated[o] / step, change.found[o] / step];
                return self.stop(setting, o, &format!("by `{name}`"), [stated, found]);
            }
        }
        let o = all.worst();
        self.stop(setting, o, "along a step of all parameters", [all.stated[o], all.found[o]])
    }

    fn stop(
        &self,
        setting: &Setting<'_>,
        output: usize,
        by: &str,
        [stated, found]: [f64; 2],
    ) -> Stop {
        let place = setting.asked.describe(output);
        let at = if place.is_empty() { String::new() } else { format!(" at {place}") };
        let of = &setting.asked.name;
        Stop::new(format!(
            "the model's derivative of `{of}`{at} {by} is wrong: at run {} it is {stated:.6e}, the difference of two runs \
             gives {found:.6e}",
            self.name
        ))
        .help("repair the derivatives of the model, or take `gradients` out of `[surrogate]`")
    }
}

//! `variational`: the normal distribution closest to the posterior.

mod climb;
mod harvest;
mod law;
mod refine;

use lacuna::math::random::Stream;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::sampler::{Harvest, Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Size, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::hamiltonian::{Point, chains, curvature};
use law::Law;
use refine::Refined;

/// Variational inference: the posterior is approximated by the normal distribution closest to it and corrected by
/// importance sampling.
///
/// It is hundreds of times cheaper than sampling and tells whether it can be trusted: each draw is weighted by the
/// ratio of the posterior to the approximation, and the tail index of these weights, the Pareto k-hat, must stay
/// below 0.7. It suits posteriors with one maximum that are nearly normal once bounded unknowns are transformed to
/// logarithms or logits; otherwise use `no_u_turn`. With a good k-hat the weights also give the evidence.
///
/// Several paths climb to the maximum (Pathfinder); along each, the normal approximation with the curvature gathered
/// so far is a candidate, and the one with the largest evidence lower bound (ELBO) is kept. Natural gradients on
/// fixed nodes then maximise the bound over mean and full covariance. The draws come from the mixture of the
/// approximations of all paths; if the k-hat of normal distributions is too large, Student's t distributions with
/// increasingly heavy tails are tried instead.
///
/// References: Zhang, Carpenter, Gelman and Vehtari, J. Mach. Learn. Res. 23 (2022) 306 (Pathfinder); Kucukelbir et
/// al., J. Mach. Learn. Res. 18 (2017) 14 (normal approximations in free coordinates); Khan and Rue, J. Mach. Learn.
/// Res. 24 (2023) 281 (natural gradients); Giordano, Ingram and Broderick, J. Mach. Learn. Res. 25 (2024) 18 (fixed
/// nodes); Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72 (k-hat).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Variational {
    /// Number of paths, at least 1, each from its own starting point. Several paths show whether there are several
    /// maxima.
    pub paths: usize,
    /// Maximum number of iterations of each path; a path ends as soon as an iteration gains nothing.
    pub iterations: usize,
    /// Number of draws of the posterior, at least 100.
    pub draws: usize,
    /// If true, the approximation of each path is refined by natural gradients; if false, it is Pathfinder's, which
    /// is cheaper and less accurate.
    pub refine: bool,
    /// If true, draws are weighted and resampled by importance; if false, they follow the normal approximation.
    pub importance: bool,
}

impl Default for Variational {
    fn default() -> Self {
        Self { paths: 4, iterations: 200, draws: 4000, refine: true, importance: true }
    }
}

/// Stage of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    Climbing,
    Refining,
    Done,
}

/// One path and the best normal approximation along it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Path {
    stage: Stage,
    point: Point,
    /// Estimate of the inverse of the negative Hessian (`d x d`), i.e. of the covariance.
    inverse: Matrix,
    best: Option<Fit>,
}

/// A normal approximation and its evidence lower bound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Fit {
    law: Law,
    bound: f64,
}

/// Outcome of one iteration of a path.
struct Progress {
    /// True if the point moved.
    moved: bool,
    /// Number of evaluations of density or gradient.
    evaluations: u64,
}

impl Variational {
    fn iterate(
        &self,
        target: &Unconstrained<'_>,
        index: usize,
        path: &mut Path,
        stream: &Stream,
    ) -> Progress {
        match path.stage {
            Stage::Done => Progress { moved: false, evaluations: 0 },
            Stage::Climbing => {
                let (progress, on) = climb::iterate(target, path, &mut stream.generator());
                if !on {
                    let refine = self.refine && path.best.is_some();
                    path.stage = if refine { Stage::Refining } else { Stage::Done };
                }
                progress
            }
            Stage::Refining => {
                let Some(fit) = path.best.take() else {
                    path.stage = Stage::Done;
                    return Progress { moved: false, evaluations: 0 };
                };
                let nodes = refine::nodes(target.dimension(), index);
                let Refined { fit, on, evaluations } = refine::iterate(target, fit, &nodes);
                path.best = Some(fit);
                if !on {
                    path.stage = Stage::Done;
                }
                Progress { moved: false, evaluations }
            }
        }
    }
}

fn read(state: &State) -> Result<Vec<Path>, Stop> {
    serde_json::from_value(state.memory.clone()).map_err(chains::foreign)
}

fn keep(paths: &[Path], state: &mut State) -> Result<(), Stop> {
    state.memory = serde_json::to_value(paths).map_err(chains::foreign)?;
    Ok(())
}

impl Component for Variational {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let counts = [("paths", self.paths, 1), ("iterations", self.iterations, 1)];
        // With fewer draws, k-hat cannot be estimated from the tail of the weights.
        for (key, found, least) in counts.into_iter().chain([("draws", self.draws, 100)]) {
            if found < least {
                complaints
                    .at(key)
                    .say(format!("too few {key}"))
                    .expected(format!("at least {least}"))
                    .found(found);
            }
        }
    }

    fn room(&self, unknowns: usize) -> Vec<Size> {
        // Two proposals a draw, each with its density, its ratio and its weight, and the draw with its density and places.
        let numbers = 3 * unknowns + 9;
        vec![Size { key: "draws", what: "the draws", value: self.draws, numbers }]
    }
}

impl Sampler for Variational {
    fn uses_gradient(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        let steps = self.iterations;
        Plan { chains: self.paths, steps, warm_up: steps, ensemble: false }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        chains::check_start(self.paths, target, &points)?;
        let free = Unconstrained::new(target);
        let log_density = target.log_density(&points);
        let starts: Vec<Point> =
            points.iter_rows().map(|x| Point::at(&free, free.free(x))).collect();
        chains::check_support(&log_density, &starts)?;
        let count = points.rows();
        let mut evaluations = 2 * count as u64;
        let mut paths = Vec::with_capacity(count);
        for point in starts {
            let found = curvature::covariance(&free, &[&point.place]);
            evaluations += found.gradients;
            let inverse = found.covariance;
            paths.push(Path { stage: Stage::Climbing, point, inverse, best: None });
        }
        let memory = serde_json::Value::Null;
        let accepted = vec![false; count];
        let mut state = State { points, log_density, accepted, evaluations, memory };
        keep(&paths, &mut state)?;
        Ok(state)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut paths = read(state)?;
        let free = Unconstrained::new(target);
        let done: Vec<Progress> = paths
            .par_iter_mut()
            .enumerate()
            .map(|(index, path)| self.iterate(&free, index, path, &stream.at(index as u64)))
            .collect();
        for (index, (path, progress)) in paths.iter().zip(done).enumerate() {
            if progress.moved {
                state.points.row_mut(index).copy_from_slice(&free.bounded(&path.point.place));
            }
            state.accepted[index] = progress.moved;
            state.evaluations += progress.evaluations;
        }
        // The log density is evaluated at the very points that are stored, because the transform back from the free
        // coordinates rounds them.
        state.log_density = target.log_density(&state.points);
        state.evaluations += state.points.rows() as u64;
        keep(&paths, state)
    }

    fn finished(&self, state: &State) -> bool {
        read(state).is_ok_and(|paths| paths.iter().all(|path| path.stage == Stage::Done))
    }

    fn harvest(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        harvest::harvest(self, target, &read(state)?, stream).map(Some)
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("paths", self.paths), Fact::new("draws", self.draws)]
    }
}

lacuna::register!(Sampler, "variational", Variational, aliases: ["vi", "advi"], revision = 2);

#[cfg(test)]
mod tests;

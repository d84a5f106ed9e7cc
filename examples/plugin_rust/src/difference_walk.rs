//! A sampler in a library.

use lacuna_plugin::linalg::Matrix;
use lacuna_plugin::math::random::{Stream, below, normal, permutation, uniform};
use lacuna_plugin::plugin::sampler::{Plan, State};
use lacuna_plugin::plugin::{Component, Context, Sampler, Target};
use lacuna_plugin::run::Stop;
use lacuna_plugin::text::Complaints;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Difference walk: many walkers, each of which jumps by the difference between two others.
///
/// The jumps have the shape of the ensemble, so that no tuning to the scales and correlations of the unknowns is
/// needed.
///
/// Reference: ter Braak, Statistics and Computing 16 (2006) 239. The built-in `affine_invariant_ensemble` has this move
/// as one of several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DifferenceWalk {
    /// Number of walkers, at least four times the number of unknowns.
    pub walkers: usize,
    /// Number of steps of each walker.
    pub steps: usize,
}

impl Default for DifferenceWalk {
    fn default() -> Self {
        Self { walkers: 100, steps: 2000 }
    }
}

impl Component for DifferenceWalk {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let least = 4 * context.parameters.len().max(1);
        if self.walkers < least {
            complaints
                .at("walkers")
                .say("too few walkers for the number of parameters")
                .expected(format!("at least {least}"))
                .found(self.walkers);
        }
    }
}

impl Sampler for DifferenceWalk {
    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.walkers, steps: self.steps, warm_up: 0, ensemble: true }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        let log_density = target.log_density(&points);
        let count = points.rows();
        if count != self.walkers || !log_density.iter().all(|l| l.is_finite()) {
            let walkers = self.walkers;
            return Err(Stop::new(format!(
                "expected {walkers} starting points of finite density, found {count} points"
            )));
        }
        let accepted = vec![false; count];
        let memory = serde_json::Value::Null;
        Ok(State { points, log_density, accepted, evaluations: count as u64, memory })
    }

    /// Each half of the walkers moves by differences within the other half, which is fixed meanwhile.
    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut rng = stream.generator();
        state.accepted.fill(false);
        let order = permutation(&mut rng, self.walkers);
        let (red, blue) = order.split_at(self.walkers / 2);
        jump(target, state, red, blue, &mut rng);
        jump(target, state, blue, red, &mut rng);
        Ok(())
    }
}

/// Moves each of `walkers` by the difference between two of `others`.
fn jump(
    target: &dyn Target,
    state: &mut State,
    walkers: &[usize],
    others: &[usize],
    rng: &mut impl Rng,
) {
    let mut points = state.points.select_rows(walkers);
    let scale = 2.38 / (2.0 * points.columns() as f64).sqrt();
    for i in 0..walkers.len() {
        let first = below(rng, others.len());
        let second = (first + 1 + below(rng, others.len() - 1)) % others.len();
        let [a, b] = [first, second].map(|k| state.points.row(others[k]));
        // A slightly random length keeps the jumps from being confined to a lattice.
        let length = scale * (1.0 + 0.1 * normal(rng));
        for ((x, a), b) in points.row_mut(i).iter_mut().zip(a).zip(b) {
            *x += length * (a - b);
        }
    }
    let log_density = target.log_density(&points);
    state.evaluations += walkers.len() as u64;
    for (i, &walker) in walkers.iter().enumerate() {
        if uniform(rng).ln() < log_density[i] - state.log_density[walker] {
            state.points.row_mut(walker).copy_from_slice(points.row(i));
            state.log_density[walker] = log_density[i];
            state.accepted[walker] = true;
        }
    }
}


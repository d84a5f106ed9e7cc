//! `skeleton`: random-walk Metropolis with step sizes from the prior.

use lacuna::math::moments::{quantile, sorted};
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::matrix::Matrix;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Random-walk Metropolis: each chain proposes a normal step of fixed width and accepts it with the ratio of the
/// densities, or stays.
///
/// Exact from the first step, without adaptation. If the data are much more informative than the prior, or unknowns are
/// correlated, most proposals are rejected: then `adaptive_metropolis` or `affine_invariant_ensemble` is better.
///
/// Reference: Metropolis, Rosenbluth, Rosenbluth, Teller and Teller, J. Chem. Phys. 21 (1953) 1087.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Number of independent chains, at least two.
    pub chains: usize,
    /// Number of steps of each chain.
    pub steps: usize,
    /// Standard deviation of a proposal in each unknown, as a fraction of that of its prior.
    pub width: f64,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { chains: 4, steps: 10_000, width: 0.5 }
    }
}

impl Component for Skeleton {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.chains < 2 {
            complaints
                .at("chains")
                .say("a single chain cannot show that it has converged")
                .expected("at least 2")
                .found(self.chains);
        }
        if self.steps == 0 {
            complaints.at("steps").say("no steps").expected("at least 1").found(0);
        }
        if !(self.width > 0.0 && self.width.is_finite()) {
            complaints
                .at("width")
                .say("chains would not move")
                .expected("a number above 0")
                .found(self.width);
        }
    }
}

/// Half the distance between the 16 % and 84 % quantiles of the prior of each unknown.
fn widths(target: &dyn Target) -> Vec<f64> {
    // Any fixed stream serves: the draws only give a width.
    let draws = target.prior_draws(1000, &Stream::root(0).named("widths"));
    let width = |j: usize| {
        let column = sorted(&draws.column(j));
        0.5 * (quantile(&column, 0.84) - quantile(&column, 0.16))
    };
    (0..target.dimension()).map(width).collect()
}

impl Sampler for Skeleton {
    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.chains, steps: self.steps, warm_up: 0, ensemble: false }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        let (rows, columns) = (points.rows(), points.columns());
        if (rows, columns) != (self.chains, target.dimension()) {
            let (chains, dimension) = (self.chains, target.dimension());
            return Err(Stop::new(format!(
                "expected {chains} starting points of {dimension} coordinates, found {rows} of {columns}"
            )));
        }
        let log_density = target.log_density(&points);
        if let Some(chain) = log_density.iter().position(|value| !value.is_finite()) {
            let number = chain + 1;
            return Err(Stop::new(format!("chain {number} starts where the density is zero")));
        }
        Ok(State {
            points,
            log_density,
            accepted: vec![false; rows],
            evaluations: rows as u64,
            memory: widths(target).into(),
        })
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let list = state.memory.as_array().map_or(&[][..], Vec::as_slice);
        let widths: Vec<f64> = list.iter().filter_map(serde_json::Value::as_f64).collect();
        // One stream per chain, so that a chain does not depend on the number of chains.
        let mut generators: Vec<_> =
            (0..self.chains).map(|chain| stream.at(chain as u64).generator()).collect();
        let mut tried = state.points.clone();
        for (chain, rng) in generators.iter_mut().enumerate() {
            for (x, width) in tried.row_mut(chain).iter_mut().zip(&widths) {
                *x += self.width * width * normal(rng);
            }
        }
        let log_density = target.log_density(&tried);
        state.evaluations += self.chains as u64;
        for (chain, rng) in generators.iter_mut().enumerate() {
            let taken = uniform(rng).ln() < log_density[chain] - state.log_density[chain];
            state.accepted[chain] = taken;
            if taken {
                state.points.row_mut(chain).copy_from_slice(tried.row(chain));
                state.log_density[chain] = log_density[chain];
            }
        }
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("chains", self.chains), Fact::new("steps", self.steps)]
    }
}

lacuna::register!(Sampler, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;

    /// Includes mean and standard deviation of a normal distribution, within four Monte Carlo errors.
    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::sampler("skeleton", &Skeleton::default()), Ok(()));
    }

    /// The standard normal distribution in one coordinate, which is also the prior.
    struct Normal;

    impl Target for Normal {
        fn dimension(&self) -> usize {
            1
        }
        fn log_density(&self, points: &Matrix) -> Vec<f64> {
            points.iter_rows().map(|x| -0.5 * x[0] * x[0]).collect()
        }
        fn log_prior(&self, points: &Matrix) -> Vec<f64> {
            self.log_density(points)
        }
        fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
            (-0.5 * point[0] * point[0], vec![-point[0]])
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            vec![(f64::NEG_INFINITY, f64::INFINITY)]
        }
        fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
            let mut rng = stream.generator();
            Matrix::from_fn(count, 1, |_, _| normal(&mut rng))
        }
    }

    /// A step of width `w` on a standard normal density is accepted with probability `2 atan(2 / w) / pi` (Sherlock and
    /// Roberts, Bernoulli 15 (2009) 774, in one dimension).
    #[test]
    fn steps_are_taken_as_often_as_theory_says() {
        let sampler = Skeleton { chains: 50, steps: 400, width: 2.0 };
        let points = Normal.prior_draws(50, &Stream::root(1));
        let mut state = sampler.start(&Normal, points).unwrap();
        let width = 2.0 * widths(&Normal)[0];
        let mut taken = 0;
        for step in 0..400 {
            sampler.step(&Normal, &mut state, &Stream::root(2).at(step)).unwrap();
            taken += state.accepted.iter().filter(|taken| **taken).count();
        }
        let (share, right) =
            (taken as f64 / 2e4, (2.0 / width).atan() / std::f64::consts::FRAC_PI_2);
        // Chains start in the stationary distribution; the correlation of neighbouring steps increases the variance by
        // a factor of at most three.
        let error = (3.0 * right * (1.0 - right) / 2e4).sqrt();
        assert!((share - right).abs() < 4.0 * error, "{share} and {right}");
    }
}

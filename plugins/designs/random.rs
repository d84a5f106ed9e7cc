//! `random`: independent uniform points.

use lacuna::data::Parameter;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::{Component, Design};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Independent points, uniform in the unit cube (plain Monte Carlo).
///
/// The simplest design, with the simplest statistics; a Latin hypercube or a Sobol' sequence covers the space better
/// with the same number of runs.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Random {}

impl Component for Random {}

impl Design for Random {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        Ok(Matrix::from_rows(
            dimension,
            (0..count).map(|i| {
                // One stream per point, so that a longer design begins with the shorter one.
                let mut rng = stream.at(i as u64).generator();
                (0..dimension).map(|_| uniform(&mut rng)).collect::<Vec<f64>>()
            }),
        ))
    }

    fn extend(
        &self,
        _: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        super::next_of_sequence(self, known, count, stream)
    }
}

lacuna::register!(Design, "random", Random, aliases: ["mc", "monte_carlo"]);

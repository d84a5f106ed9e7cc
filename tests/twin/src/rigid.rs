//! A design that leaves out all that a design may leave out.

use lacuna_plugin::linalg::Matrix;
use lacuna_plugin::math::random::{Stream, uniform};
use lacuna_plugin::plugin::{Component, Design};
use lacuna_plugin::run::Stop;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Random points, beside which there are no others.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rigid {}

impl Component for Rigid {}

impl Design for Rigid {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        let mut rng = stream.generator();
        Ok(Matrix::from_fn(count, dimension, |_, _| uniform(&mut rng)))
    }
}

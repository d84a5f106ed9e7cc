//! A design without any optional functions.

use lacuna_plugin::linalg::Matrix;
use lacuna_plugin::math::random::{Stream, uniform};
use lacuna_plugin::plugin::{Component, Design};
use lacuna_plugin::run::Stop;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Random points that cannot be extended.
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

//! Designs of libraries.

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::Design;
use lacuna::plugin::design::fixed_points;
use lacuna::run::Stop;
use lacuna_abi::Refusal;
use lacuna_abi::object::{numbers, numbers_if_any};
use lacuna_abi::table::DesignFunctions;
use lacuna_linalg::Matrix;

use super::Plugin;

impl Plugin<DesignFunctions> {
    fn pointed(&self, count: usize, dimension: usize, key: &Stream) -> Result<Matrix, Refusal> {
        // SAFETY: the buffer holds `count x dimension` numbers.
        let call = |to| unsafe { self.object.points(count, dimension, key, to) };
        in_cube(numbers(count * dimension, call)?, count, dimension)
    }

    fn placed(
        &self,
        parameters: &[Parameter],
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Refusal> {
        let dimension = parameters.len();
        if self.object.functions.place.is_none() {
            return self.pointed(count, dimension, stream);
        }
        let text = serde_json::to_string(parameters)?;
        // SAFETY: the buffer holds `count x dimension` numbers.
        let call = |to| unsafe { self.object.place(&text, count, dimension, stream, to) };
        in_cube(numbers(count * dimension, call)?, count, dimension)
    }

    /// Further points; `None` where the design has no way to place them.
    fn extended(
        &self,
        parameters: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Option<Matrix>, Refusal> {
        let (text, dimension) = (serde_json::to_string(parameters)?, parameters.len());
        // SAFETY: the buffer holds `count x dimension` numbers.
        let call = |to| unsafe { self.object.extend(&text, known, count, stream, to) };
        let points = numbers_if_any(count * dimension, call)?;
        points.map(|points| in_cube(points, count, dimension)).transpose()
    }
}

/// Points that must lie in the open unit cube.
fn in_cube(points: Vec<f64>, count: usize, dimension: usize) -> Result<Matrix, Refusal> {
    match points.iter().find(|x| !(0.0 < **x && **x < 1.0)) {
        None => Ok(Matrix::from_vec(count, dimension, points)),
        Some(x) => Err(Refusal::stop(format!(
            "a point of the design lies outside the open unit cube, at {x}"
        ))),
    }
}

impl Design for Plugin<DesignFunctions> {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        self.object.or_stop(self.pointed(count, dimension, stream))
    }

    fn place(
        &self,
        parameters: &[Parameter],
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        self.object.or_stop(self.placed(parameters, count, stream))
    }

    fn extend(
        &self,
        parameters: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        let points = self.object.or_stop(self.extended(parameters, known, count, stream))?;
        points.ok_or_else(fixed_points)
    }
}

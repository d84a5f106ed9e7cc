//! Designs of libraries.

use super::Plugin;
use super::plugin::optional;
use crate::data::Parameter;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::Design;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::table::{DesignFunctions, Key, Numbers, Text};
use crate::plugin::design::fixed_points;
use crate::run::Stop;

impl Plugin<DesignFunctions> {
    fn placed(
        &self,
        parameters: Option<&[Parameter]>,
        count: usize,
        dimension: usize,
        stream: &Stream,
    ) -> Result<Matrix, Refusal> {
        let (this, functions) = (self.object.this, &self.object.functions);
        let key = Key { words: stream.key() };
        let points = match (parameters, functions.place) {
            (Some(parameters), Some(place)) => {
                let text = serde_json::to_string(parameters)?;
                self.object.numbers("place", count * dimension, |to, a| {
                    // SAFETY: the function belongs to the plugin; the buffer holds `count x dimension` numbers.
                    unsafe { place(this, Text::of(&text), count, dimension, key, to, a) }
                })?
            }
            _ => self.object.numbers("points", count * dimension, |to, a| {
                // SAFETY: as above.
                optional(functions.points, |f| unsafe { f(this, count, dimension, key, to, a) })
            })?,
        };
        in_cube(points, count, dimension)
    }

    /// Further points; `None` where the design has no way to place them.
    fn extended(
        &self,
        parameters: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Option<Matrix>, Refusal> {
        let Some(ask) = self.object.functions.extend else { return Ok(None) };
        let (this, text) = (self.object.this, serde_json::to_string(parameters)?);
        let (key, there) = (Key { words: stream.key() }, Numbers::of(known));
        let dimension = parameters.len();
        let points = self.object.ask_numbers("extend", count * dimension, |to, a| {
            // SAFETY: as in `placed`; the known points are there until it returns.
            unsafe { ask(this, Text::of(&text), there, count, key, to, a) }
        })?;
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
        self.object.or_stop(self.placed(None, count, dimension, stream))
    }

    fn place(
        &self,
        parameters: &[Parameter],
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        let dimension = parameters.len();
        self.object.or_stop(self.placed(Some(parameters), count, dimension, stream))
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

//! Designs: where the simulator is run.

use super::Component;
use crate::data::Parameter;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::run::Stop;

/// Places points in the unit cube; the parameters' design distributions map them to physical values.
pub trait Design: Component {
    /// `count` points in the open unit cube of `dimension` axes, one a row.
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop>;

    /// `count` points of the cube for these parameters: a design whose points depend on the laws that
    /// will map them (the nodes of a quadrature rule) overrides this.
    fn place(
        &self,
        parameters: &[Parameter],
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        self.points(count, parameters.len(), stream)
    }

    /// `count` further points beside those of `known`, which this design placed and which stay where they are;
    /// `stream` is the one that placed them. A design that cannot go on refuses.
    fn extend(
        &self,
        _parameters: &[Parameter],
        _known: &Matrix,
        _count: usize,
        _stream: &Stream,
    ) -> Result<Matrix, Stop> {
        Err(fixed_points())
    }
}

/// That a design cannot go on beside the points that it placed.
pub(super) fn fixed_points() -> Stop {
    Stop::new("this design cannot be extended without moving its points")
        .help("take another design for further runs, or a greater number of `runs`")
}

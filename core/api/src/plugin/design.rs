//! Designs: the points at which the simulator is run.

use lacuna_base::data::Parameter;
use lacuna_base::math::random::Stream;
use lacuna_base::matrix::Matrix;
use lacuna_base::run::Stop;

use super::Component;

/// Places points in the unit cube; the parameters' design distributions map them to physical values.
pub trait Design: Component {
    /// `count` points in the open unit cube, `count x dimension`.
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop>;

    /// `count` points of the unit cube for these parameters. Override this in a design whose points depend on the
    /// distributions that will map them (the nodes of a quadrature rule).
    fn place(
        &self,
        parameters: &[Parameter],
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        self.points(count, parameters.len(), stream)
    }

    /// `count` further points besides those of `known`, which this design placed and which remain; `stream` is the
    /// stream they were placed with.
    ///
    /// # Errors
    /// If the design cannot be extended.
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

/// The error of a design that cannot be extended.
pub fn fixed_points() -> Stop {
    Stop::new("this design cannot be extended without moving its points")
        .help("take another design for further runs, or a greater number of `runs`")
}

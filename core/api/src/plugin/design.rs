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

    /// True for a sequential design: its first batch is [`Design::place`], every further one follows from what the runs
    /// returned ([`Design::next`]).
    fn is_sequential(&self) -> bool {
        false
    }

    /// The next batch of a sequential design, from all batches before it; `stream` is that of the design.
    ///
    /// The batches are all that the method knows: it keeps no state of its own, so that an interrupted study goes on
    /// with the same points.
    ///
    /// # Errors
    /// If the runs that returned are too few to go on.
    fn next(&self, _batches: &[Batch], _stream: &Stream) -> Result<Next, Stop> {
        Ok(Next::Complete(String::new()))
    }
}

/// One batch of runs of a sequential design, compared with the measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// Number of runs that were placed, including those that failed.
    pub placed: usize,
    /// Normal scores of the parameters under their design distributions ([`Distribution::score`]) for each run with a
    /// response, `runs x parameters`.
    ///
    /// [`Distribution::score`]: lacuna_base::math::distribution::Distribution::score
    pub scores: Matrix,
    /// Difference between the response and the mean of the replicates, in standard deviations of that mean's noise,
    /// `runs x data`.
    pub residuals: Matrix,
}

/// Continuation of a sequential design.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// Normal scores of the parameters of the next batch, `runs x parameters`.
    Place(Matrix),
    /// No further batch; the text says why, for the progress messages.
    Complete(String),
}

/// The error of a design that cannot be extended.
pub fn fixed_points() -> Stop {
    Stop::new("this design cannot be extended without moving its points")
        .help("take another design for further runs, or a greater number of `runs`")
}

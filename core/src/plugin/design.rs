//! Designs: where the simulator is run.

use super::Component;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::run::Stop;

/// Places points in the unit cube; the parameters' design distributions map them to physical values.
pub trait Design: Component {
    /// `count` points in the open unit cube of `dimension` axes, one a row.
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop>;
}

//! Counting of calls, intervals, and checks that the methods share.

mod checks;
mod counted;
mod interval;

pub use checks::{at_least, between, positive, standard_normal};
pub use counted::Counted;
pub use interval::{clopper_pearson, log_normal};

use lacuna::math::random::normal;
use lacuna_linalg::Matrix;
use rand::rngs::ChaCha8Rng;

/// Independent standard normal points, `count x dimension`.
pub fn normals(count: usize, dimension: usize, rng: &mut ChaCha8Rng) -> Matrix {
    Matrix::from_fn(count, dimension, |_, _| normal(rng))
}

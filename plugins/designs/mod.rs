//! Designs: the points of parameter space at which the simulator is run.

pub mod ensemble_kalman;
pub mod latin_hypercube;
pub mod morris;
pub mod quadrature;
pub mod random;
pub mod sobol;

use lacuna::math::random::Stream;
use lacuna::plugin::Design;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

/// Returns the next `count` points (`count x d`, in the unit cube) of a design whose longer versions begin with the
/// shorter ones.
fn next_of_sequence(
    design: &dyn Design,
    known: &Matrix,
    count: usize,
    stream: &Stream,
) -> Result<Matrix, Stop> {
    let all = design.points(known.rows() + count, known.columns(), stream)?;
    Ok(all.select_rows(&(known.rows()..all.rows()).collect::<Vec<_>>()))
}

//! Designs: where the simulator is run.

pub mod latin_hypercube;
pub mod quadrature;
pub mod random;
pub mod sobol;

use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::Design;
use lacuna::run::Stop;

/// The next points of a design whose longer ones begin with the shorter.
fn next_of_sequence(
    design: &dyn Design,
    known: &Matrix,
    count: usize,
    stream: &Stream,
) -> Result<Matrix, Stop> {
    let all = design.points(known.rows() + count, known.columns(), stream)?;
    Ok(all.select_rows(&(known.rows()..all.rows()).collect::<Vec<_>>()))
}

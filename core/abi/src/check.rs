//! Checks of answers: numbers, densities, marks, shapes.

use lacuna::matrix::Matrix;

use crate::Refusal;

/// Complains of what is no number, such as what was never written.
pub fn numbers_only(what: &str, numbers: &[f64]) -> Result<(), Refusal> {
    match numbers.iter().position(|x| x.is_nan()) {
        None => Ok(()),
        Some(i) => {
            let count = numbers.len();
            Err(Refusal::stop(format!("`{what}` gives no number as value {} of {count}", i + 1)))
        }
    }
}

/// Complains of what is no log density: those are finite or minus infinity.
pub fn densities_only(what: &str, densities: &[f64]) -> Result<(), Refusal> {
    numbers_only(what, densities)?;
    let endless = densities.iter().position(|x| *x == f64::INFINITY);
    endless.map_or(Ok(()), |i| Err(odd(what, densities, i)))
}

/// Complains of what is not finite.
pub fn finite_only(what: &str, numbers: &[f64]) -> Result<(), Refusal> {
    numbers_only(what, numbers)?;
    let infinite = numbers.iter().position(|x| x.is_infinite());
    infinite.map_or(Ok(()), |i| Err(odd(what, numbers, i)))
}

/// A number that is out of place.
fn odd(what: &str, numbers: &[f64], i: usize) -> Refusal {
    let (x, count) = (numbers[i], numbers.len());
    Refusal::stop(format!("`{what}` gives {x} as value {} of {count}", i + 1))
}

/// Marks, each of which must be 0 or 1; a buffer that was not written holds [`UNMARKED`].
pub fn marks(what: &str, marks: &[u8]) -> Result<Vec<bool>, Refusal> {
    let mark = |(i, mark): (usize, &u8)| match mark {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Refusal::stop(format!(
            "`{what}` gives {other} as mark {} of {}, expected 0 or 1",
            i + 1,
            marks.len()
        ))),
    };
    marks.iter().enumerate().map(mark).collect()
}

/// The content of a buffer of marks before it is written.
pub const UNMARKED: u8 = 255;

/// Complains of a matrix of another shape.
pub fn shaped(
    what: &'static str,
    matrix: &Matrix,
    rows: usize,
    columns: usize,
) -> Result<(), Refusal> {
    if matrix.rows() == rows && matrix.columns() == columns {
        return Ok(());
    }
    let (found_rows, found_columns) = (matrix.rows(), matrix.columns());
    Err(Refusal::stop(format!(
        "`{what}` answers {found_rows} rows of {found_columns} numbers where {rows} of {columns} belong"
    )))
}

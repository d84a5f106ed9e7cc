//! Polynomials as numbers for other programs.

use lacuna::plugin::surrogate::Tables;
use lacuna_linalg::Matrix;

use super::coordinate::Coordinate;
use super::terms::Basis;

/// Adds the standard variables of the parameters, the recurrences of their polynomials and the multi-indices of the terms.
///
/// # Errors
/// The reason if a standard variable has no closed form.
pub fn add_basis(basis: &Basis, tables: &mut Tables) -> Result<(), String> {
    let (coordinates, terms) = (basis.coordinates(), basis.terms());
    let dimension = coordinates.len();
    let exponents: Vec<f64> = terms.exponents().iter().map(|&e| f64::from(e)).collect();
    let degree = terms.exponents().iter().copied().max().unwrap_or(0).max(1);
    let closed: Vec<[f64; 4]> =
        coordinates.iter().map(Coordinate::closed).collect::<Result<_, _>>()?;
    for (k, name) in ["log", "centre", "scale", "bound"].iter().enumerate() {
        tables.column(name, "parameter", closed.iter().map(|numbers| numbers[k]).collect());
    }
    let recurrences: Vec<_> =
        coordinates.iter().map(|c| c.recurrence(usize::from(degree))).collect();
    // A polynomial that no term has may be unknown: zero and one keep the recurrence finite.
    let or = |values: &[f64], n: usize, neutral| values.get(n).copied().unwrap_or(neutral);
    let centre = |i: usize, n: usize| or(&recurrences[i].centres, n, 0.0);
    let size = |i: usize, n: usize| or(&recurrences[i].sizes, n, 1.0);
    let table = |of: &dyn Fn(usize, usize) -> f64| Matrix::from_fn(dimension, degree.into(), of);
    tables.matrix("recurrence_centre", "parameter", "degree", &table(&centre));
    tables.matrix("recurrence_size", "parameter", "degree", &table(&size));
    let exponents = Matrix::from_vec(terms.len(), dimension, exponents);
    tables.matrix("exponent", "term", "parameter", &exponents);
    Ok(())
}

//! Weighted sums of expansions: one expansion over the union of their terms.

use std::collections::BTreeMap;

use lacuna::plugin::Forward as _;
use lacuna::plugin::surrogate::Summand;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::add_scaled;

use super::emulator::Expansion;
use super::terms::{Basis, Terms};

/// Returns the sum if the parameters of all parts have the same standard variables and families, otherwise `None`.
/// Errors and summary are those of the first part.
pub(super) fn sum(parts: &[Summand<'_>], offset: &[f64]) -> Result<Option<Expansion>, Stop> {
    let loaded: Vec<Expansion> =
        parts.iter().map(|part| Expansion::from_bytes(part.bytes)).collect::<Result<_, Stop>>()?;
    let Some(first) = loaded.first() else { return Ok(None) };
    let outputs = offset.len();
    let alike = |other: &Expansion| {
        other.basis_coordinates() == first.basis_coordinates() && other.outputs() == outputs
    };
    if !loaded.iter().all(alike) || parts.iter().any(|part| part.weights.len() != outputs) {
        return Ok(None);
    }
    let dimension = first.dimension();
    let mut places: BTreeMap<Vec<u16>, usize> = BTreeMap::new();
    let mut exponents = Vec::new();
    let mut place = |term: &[u16]| {
        let next = places.len();
        let found = *places.entry(term.to_vec()).or_insert(next);
        if found == next {
            exponents.extend_from_slice(term);
        }
        found
    };
    // The polynomial of degree zero is 1.
    let constant = place(&vec![0; dimension]);
    let rows: Vec<Vec<usize>> = loaded
        .iter()
        .map(|part| (0..part.terms().len()).map(|t| place(part.terms().term(t))).collect())
        .collect();
    let mut coefficients = Matrix::zeros(places.len(), outputs);
    add_scaled(coefficients.row_mut(constant), 1.0, offset);
    for ((part, expansion), rows) in parts.iter().zip(&loaded).zip(&rows) {
        for (&row, own) in rows.iter().zip(expansion.of_terms().iter_rows()) {
            let weighted = own.iter().zip(part.weights).map(|(c, w)| c * w);
            coefficients.row_mut(row).iter_mut().zip(weighted).for_each(|(sum, c)| *sum += c);
        }
    }
    let basis = Basis::new(first.basis_coordinates(), Terms::from_exponents(dimension, exponents));
    Ok(Some(first.clone().with(basis, coefficients)))
}

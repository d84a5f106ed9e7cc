//! Information of the data about the members of populations.

use lacuna::data::Population;
use lacuna_linalg::{Cholesky, Matrix};

use super::Posterior;

/// Members that the data determine together: those of one group.
#[derive(Debug, Clone, PartialEq)]
pub struct Together {
    /// Places of the members among the unknowns.
    pub places: Vec<usize>,
    /// Negative second derivatives of the log-likelihood by these members, on the scale of their populations (values or
    /// logarithms), with all other unknowns fixed.
    pub information: Matrix,
    /// Place of the scale of each member's population.
    scales: Vec<usize>,
}

impl Together {
    /// Share of each population's variance that the data leave to a member given location and scale, at a point of natural
    /// values: 1 if they say nothing of it, 0 if they determine it. It is the weight of the location in the member's mean, the
    /// factor by which the member is pulled from its own estimate towards the population.
    ///
    /// For one member with the precision `h` of its data that is `1 / (1 + h s²)`; for several of one group the diagonal of
    /// `(H + S⁻²)⁻¹ S⁻²`.
    pub fn pooling(&self, natural: &[f64]) -> Vec<f64> {
        let scale: Vec<f64> = self.scales.iter().map(|&place| natural[place]).collect();
        let count = scale.len();
        let standard = Matrix::from_fn(count, count, |i, j| {
            scale[i] * scale[j] * self.information[(i, j)] + if i == j { 1.0 } else { 0.0 }
        });
        let Ok(factor) = Cholesky::new(&standard) else { return vec![f64::NAN; count] };
        let of = |k: usize| {
            let mut unit = vec![0.0; count];
            unit[k] = 1.0;
            factor.solve(&mut unit);
            unit[k]
        };
        (0..count).map(of).collect()
    }
}

impl Posterior<'_> {
    /// Information of the data about the members of each group at natural values.
    pub fn information(&self, natural: &[f64]) -> Vec<Together> {
        let mut found: Vec<(&String, Vec<(usize, &Population)>)> = Vec::new();
        for population in self.populations() {
            for (&place, group) in population.members.iter().zip(&population.groups) {
                match found.iter_mut().find(|(other, _)| *other == group) {
                    Some((_, members)) => members.push((place, population)),
                    None => found.push((group, vec![(place, population)])),
                }
            }
        }
        found.iter().map(|(_, members)| self.together(natural, members)).collect()
    }

    /// Central differences of the gradient, with steps of a thousandth of the population's scale.
    fn together(&self, natural: &[f64], members: &[(usize, &Population)]) -> Together {
        let d = self.parameters().len();
        let slopes = |point: &[f64]| -> Vec<f64> {
            let gradient = self.likelihood.value_and_gradient(&point[..d], &point[d..]).1;
            let own = |&(place, population): &(usize, &Population)| {
                let (low, _) = population.support();
                gradient[place] * if low == 0.0 { point[place] } else { 1.0 }
            };
            members.iter().map(own).collect()
        };
        let mut columns = Vec::new();
        for &(place, population) in members {
            let step = 1e-3 * natural[population.scale];
            let moved = |sign: f64| {
                let mut point = natural.to_vec();
                point[place] = match population.support().0 {
                    0.0 => point[place] * (sign * step).exp(),
                    _ => point[place] + sign * step,
                };
                slopes(&point)
            };
            let (above, below) = (moved(1.0), moved(-1.0));
            let column = above.iter().zip(&below).map(|(a, b)| -(a - b) / (2.0 * step));
            columns.push(column.collect::<Vec<f64>>());
        }
        let count = members.len();
        let entry = |i: usize, j: usize| {
            let value = 0.5 * (columns[j][i] + columns[i][j]);
            if value.is_finite() { value } else { 0.0 }
        };
        let information = positive(Matrix::from_fn(count, count, entry));
        Together {
            places: members.iter().map(|(place, _)| *place).collect(),
            scales: members.iter().map(|(_, population)| population.scale).collect(),
            information,
        }
    }
}

/// The nearest matrix without negative eigenvalues: away from a maximum the curvature may have some.
fn positive(matrix: Matrix) -> Matrix {
    let Ok(eigen) = lacuna_linalg::symmetric_eigen(&matrix) else { return matrix };
    let count = matrix.rows();
    let entry = |i: usize, j: usize| -> f64 {
        let of =
            |k: usize| eigen.values[k].max(0.0) * eigen.vectors[(i, k)] * eigen.vectors[(j, k)];
        (0..count).map(of).sum()
    };
    Matrix::from_fn(count, count, entry)
}

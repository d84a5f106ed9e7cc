//! Inner products of whitened curves for any autoregression.
//!
//! A value that directly follows enough others is whitened by `y_t - a_1 y_(t-1) - ... - a_p y_(t-p)`. The sum of the
//! products of such values is quadratic in the coefficients, with matrices that are computed once. The values at the
//! beginning and after holes have predictors of their own, and are whitened one by one.

use lacuna_linalg::{Matrix, multiply_transposed};

use super::autoregression::Autoregression;
use super::succession::Succession;

/// Curves at the same places.
pub(super) struct Lagged<'a> {
    curves: Vec<&'a [f64]>,
    /// For the lags `i <= j`, the sums of the products of one curve at lag `i` and another at lag `j`, both ways: lower
    /// triangles by rows, in the order of `j`, then of `i`.
    sums: Vec<Vec<f64>>,
    /// The values that do not follow `most` others directly.
    edges: Vec<usize>,
}

impl<'a> Lagged<'a> {
    /// The curves with their products up to the lag `most`, the highest order of an autoregression.
    pub fn new(curves: Vec<&'a [f64]>, places: &[usize], most: usize) -> Self {
        let follows = |t: &usize| *t >= most && places[*t] - places[*t - most] == most;
        let (inner, edges): (Vec<usize>, Vec<usize>) = (0..places.len()).partition(follows);
        let shifted = |lag: usize| {
            let own = curves.iter().map(|curve| inner.iter().map(|t| curve[t - lag]).collect());
            Matrix::from_rows(inner.len(), own.collect::<Vec<Vec<f64>>>())
        };
        let shifted: Vec<Matrix> = (0..=most).map(shifted).collect();
        let mut sums = Vec::new();
        for j in 0..=most {
            for i in 0..=j {
                let products = multiply_transposed(&shifted[i], &shifted[j]);
                let both = |k: usize, l: usize| {
                    let other = if i < j { products[(l, k)] } else { 0.0 };
                    products[(k, l)] + other
                };
                let rows = (0..curves.len()).flat_map(|k| (0..=k).map(move |l| (k, l)));
                sums.push(rows.map(|(k, l)| both(k, l)).collect());
            }
        }
        Self { curves, sums, edges }
    }

    /// The inner products of the curves whitened with an autoregression: a lower triangle by rows.
    pub fn gram(&self, memory: &Autoregression, succession: &Succession) -> Vec<f64> {
        let order = memory.order();
        let weight = |lag: usize| if lag == 0 { 1.0 } else { -memory.coefficients()[lag - 1] };
        let size = self.curves.len();
        let mut gram = vec![0.0; size * (size + 1) / 2];
        for j in 0..=order {
            for i in 0..=j {
                let factor = weight(i) * weight(j);
                let sums = &self.sums[j * (j + 1) / 2 + i];
                gram.iter_mut().zip(sums).for_each(|(g, s)| *g += factor * s);
            }
        }
        for &t in &self.edges {
            let (weights, error) = succession.predictor(t);
            let white = |curve: &&[f64]| {
                let before = weights.iter().zip(curve[..t].iter().rev());
                (curve[t] - before.map(|(a, x)| a * x).sum::<f64>()) / error
            };
            let row: Vec<f64> = self.curves.iter().map(white).collect();
            let mut rest = &mut gram[..];
            for (k, x) in row.iter().enumerate() {
                let (own, next) = rest.split_at_mut(k + 1);
                own.iter_mut().zip(&row).for_each(|(g, y)| *g += x * y);
                rest = next;
            }
        }
        gram
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna_linalg::vector::dot;

    /// The definition: curves are whitened one by one.
    #[test]
    fn products_are_those_of_the_whitened_curves() {
        let places: Vec<usize> = (0..12).chain(15..16).chain(20..31).chain(33..60).collect();
        let curve = |k: usize| -> Vec<f64> {
            places.iter().map(|&p| ((0.3 + 0.4 * k as f64) * p as f64).sin() + 0.1).collect()
        };
        let curves: Vec<Vec<f64>> = (0..4).map(curve).collect();
        let lagged = Lagged::new(curves.iter().map(|c| &c[..]).collect(), &places, 3);
        for reflections in [&[][..], &[0.9], &[0.6, -0.4], &[-0.3, 0.5, 0.2]] {
            let memory = Autoregression::of_reflections(reflections);
            let succession = memory.on(&places);
            let white: Vec<Vec<f64>> = curves
                .iter()
                .map(|curve| {
                    let mut curve = curve.clone();
                    succession.whiten(&mut curve);
                    curve
                })
                .collect();
            let gram = lagged.gram(&memory, &succession);
            for k in 0..4 {
                for l in 0..=k {
                    let exact = dot(&white[k], &white[l]);
                    let found = gram[k * (k + 1) / 2 + l];
                    assert!(
                        (found - exact).abs() < 1e-10,
                        "{reflections:?} {k} {l}: {found} {exact}"
                    );
                }
            }
        }
    }
}

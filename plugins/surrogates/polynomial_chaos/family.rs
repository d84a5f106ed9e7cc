//! Families of orthonormal polynomials in one variable, and where a parameter sits in its family.

use lacuna::data::Parameter;
use lacuna::linalg::lanes::Lanes;
use lacuna::math::distribution::Distribution;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A family of polynomials, orthonormal under the law of its standard variable.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// Legendre polynomials, orthonormal under the uniform law on (-1, 1): for parameters with a
    /// uniform design.
    #[default]
    Legendre,
}

impl Family {
    /// The polynomials of degree `0..values.len()` at `z`.
    pub fn values(self, z: f64, values: &mut [f64]) {
        match self {
            Self::Legendre => legendre(z, values),
        }
    }

    /// The polynomials of degree `0..values.len()` at `z` and their derivatives there.
    pub fn derivatives(self, z: f64, values: &mut [f64], derivatives: &mut [f64]) {
        match self {
            Self::Legendre => legendre_derivatives(z, values, derivatives),
        }
    }

    /// The weights of the product of two polynomials in the family: `psi_m psi_n = sum_r weights[r]
    /// psi_{m + n - 2 r}`, `r` from 0 to the lesser of the degrees.
    pub fn product(self, m: usize, n: usize) -> Vec<f64> {
        match self {
            Self::Legendre => legendre_product(m, n),
        }
    }

    /// Whether the standard variable is in the support of the family's law.
    pub fn supports(self, z: f64) -> bool {
        match self {
            // Values on the bounds come back from physical units with round-off.
            Self::Legendre => z.abs() <= 1.0 + 1e-9,
        }
    }

    /// The standard coordinate of a parameter, or what stands against this family in words.
    pub fn coordinate(self, parameter: &Parameter) -> Result<Coordinate, String> {
        let name = &parameter.name;
        match (self, &parameter.design) {
            (Self::Legendre, Distribution::Uniform([low, high])) if low < high => Ok(Coordinate {
                family: self,
                centre: 0.5 * (low + high),
                scale: 0.5 * (high - low),
            }),
            (Self::Legendre, Distribution::Uniform([low, high])) => Err(format!(
                "the design of parameter `{name}` runs from {low} to {high}, which is no interval"
            )),
            (Self::Legendre, other) => Err(format!(
                "basis `legendre` needs a uniform design, but that of parameter `{name}` is `{}`",
                other.name()
            )),
        }
    }
}

/// The standard variable `z = (x - centre) / scale` of one parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// The family of its polynomials.
    pub family: Family,
    /// The value of the parameter at `z = 0`, in its unit.
    pub centre: f64,
    /// The change of the parameter for a change of 1 in `z`, in its unit.
    pub scale: f64,
}

impl Coordinate {
    /// The standard variable at a value of the parameter.
    pub fn standard(&self, x: f64) -> f64 {
        (x - self.centre) / self.scale
    }

    /// The polynomials of degree `0..table.len()` at some values of the parameter, side by side.
    pub fn values(&self, parameter: impl Iterator<Item = f64>, table: &mut [Lanes]) {
        let mut values = vec![0.0; table.len()];
        for (l, x) in parameter.enumerate() {
            self.family.values(self.standard(x), &mut values);
            for (entry, value) in table.iter_mut().zip(&values) {
                entry[l] = *value;
            }
        }
    }
}

/// `sqrt(2 n + 1) P_n(z)` by the three-term recurrence (Abramowitz and Stegun 22.7.10).
fn legendre(z: f64, values: &mut [f64]) {
    legendre_raw(z, values);
    normalise(values);
}

/// With the derivatives by `P'_{n+1} = P'_{n-1} + (2 n + 1) P_n`, which holds at the ends too.
fn legendre_derivatives(z: f64, values: &mut [f64], derivatives: &mut [f64]) {
    legendre_raw(z, values);
    for n in 0..derivatives.len() {
        derivatives[n] = match n {
            0 => 0.0,
            1 => 1.0,
            _ => derivatives[n - 2] + (2 * n - 1) as f64 * values[n - 1],
        };
    }
    normalise(values);
    normalise(derivatives);
}

fn legendre_raw(z: f64, values: &mut [f64]) {
    for n in 0..values.len() {
        values[n] = match n {
            0 => 1.0,
            1 => z,
            _ => {
                let m = n as f64;
                ((2.0 * m - 1.0) * z * values[n - 1] - (m - 1.0) * values[n - 2]) / m
            }
        };
    }
}

/// Adams (1878), in the form of Bailey (1933): with `A_k = (1/2)_k / k!`,
/// `P_m P_n = sum_r A_r A_{m-r} A_{n-r} / A_{m+n-r} (2m+2n-4r+1)/(2m+2n-2r+1) P_{m+n-2r}`.
fn legendre_product(m: usize, n: usize) -> Vec<f64> {
    let mut a = vec![1.0];
    for k in 1..=m + n {
        a.push(a[k - 1] * (2 * k - 1) as f64 / (2 * k) as f64);
    }
    let odd = |k: usize| (2 * k + 1) as f64;
    let weight = |r: usize| {
        let degree = m + n - 2 * r;
        let plain = a[r] * a[m - r] * a[n - r] / a[m + n - r] * odd(degree) / odd(m + n - r);
        plain * (odd(m) * odd(n) / odd(degree)).sqrt()
    };
    (0..=m.min(n)).map(weight).collect()
}

fn normalise(values: &mut [f64]) {
    for (n, value) in values.iter_mut().enumerate() {
        *value *= ((2 * n + 1) as f64).sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::linalg::{Matrix, symmetric_eigen};

    /// Gauss nodes and weights of the uniform law on (-1, 1) by Golub and Welsch (1969): the
    /// eigenvalues of the Jacobi matrix and the squares of its vectors' first entries.
    fn gauss(n: usize) -> Vec<(f64, f64)> {
        let beside = |k: usize| k as f64 / ((4 * k * k) as f64 - 1.0).sqrt();
        let jacobi = Matrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            1 => beside(i.max(j)),
            _ => 0.0,
        });
        let eigen = symmetric_eigen(&jacobi).unwrap();
        (0..n).map(|k| (eigen.values[k], eigen.vectors[(0, k)].powi(2))).collect()
    }

    #[test]
    fn legendre_polynomials_have_their_closed_forms() {
        // Source: Abramowitz and Stegun, table 22.9.
        let mut p = [0.0; 7];
        let mut d = [0.0; 7];
        for i in 0..=20 {
            let z = -1.2 + 0.12 * f64::from(i);
            Family::Legendre.derivatives(z, &mut p, &mut d);
            let mut alone = [0.0; 7];
            Family::Legendre.values(z, &mut alone);
            assert_eq!(p, alone);
            let norm = |n: usize| ((2 * n + 1) as f64).sqrt();
            let values = [
                (2, (3.0 * z * z - 1.0) / 2.0, 3.0 * z),
                (3, (5.0 * z.powi(3) - 3.0 * z) / 2.0, (15.0 * z * z - 3.0) / 2.0),
                (
                    4,
                    (35.0 * z.powi(4) - 30.0 * z * z + 3.0) / 8.0,
                    (140.0 * z.powi(3) - 60.0 * z) / 8.0,
                ),
                (
                    6,
                    (231.0 * z.powi(6) - 315.0 * z.powi(4) + 105.0 * z * z - 5.0) / 16.0,
                    (1386.0 * z.powi(5) - 1260.0 * z.powi(3) + 210.0 * z) / 16.0,
                ),
            ];
            for (n, value, slope) in values {
                assert!((p[n] - norm(n) * value).abs() < 1e-12);
                assert!((d[n] - norm(n) * slope).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn products_of_polynomials_are_the_sums_of_their_weights() {
        let mut psi = [0.0; 41];
        for z in [-1.0, -0.9, -0.33, 0.0, 0.25, 0.77, 1.0] {
            Family::Legendre.values(z, &mut psi);
            for m in 0..=20 {
                for n in 0..=20 {
                    let weights = Family::Legendre.product(m, n);
                    assert!(weights.iter().all(|w| *w > 0.0));
                    let terms = weights.iter().enumerate().map(|(r, w)| w * psi[m + n - 2 * r]);
                    let (sum, product) = (terms.sum::<f64>(), psi[m] * psi[n]);
                    assert!((sum - product).abs() < 1e-12 * ((2 * m + 1) * (2 * n + 1)) as f64);
                }
            }
        }
    }

    #[test]
    fn legendre_polynomials_are_orthonormal() {
        let mut p = [0.0; 21];
        let mut products = Matrix::zeros(21, 21);
        for (z, weight) in gauss(21) {
            Family::Legendre.values(z, &mut p);
            for i in 0..21 {
                for j in 0..21 {
                    products[(i, j)] += weight * p[i] * p[j];
                }
            }
        }
        for i in 0..21 {
            for j in 0..21 {
                assert!((products[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
        }
    }
}

//! Families of orthonormal polynomials in one variable.

use lacuna::math::distribution::Distribution;
use lacuna::math::special::ln_gamma;
use lacuna_linalg::lanes::{LANES, Lanes};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Family of polynomials, orthonormal under the distribution of its standard variable.
///
/// If the parameter's design has another distribution, the polynomials are those of `z = F_family^-1(F_design(x))`,
/// which has the family's distribution; beyond the design's support they keep the values at its bounds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// For each parameter the family of its design: `legendre` for `uniform`, `hermite` for `normal`, `laguerre` for
    /// `exponential` and `gamma`, `jacobi` for `beta`, and `arbitrary` for all others.
    #[default]
    Auto,
    /// Legendre polynomials, for the uniform distribution. With a `log_uniform` design, polynomials in the logarithm.
    Legendre,
    /// Hermite polynomials, for the normal distribution. With a `log_normal` design, polynomials in the logarithm:
    /// often better than `arbitrary`, because polynomials in a log-normal parameter cannot represent every response.
    Hermite,
    /// Laguerre polynomials, for the gamma distribution. For other designs with a lower bound, the gamma distribution
    /// with the same mean and variance above it; for designs without a lower bound, the exponential distribution.
    Laguerre,
    /// Jacobi polynomials, for the beta distribution. For other bounded designs, the beta distribution with the same
    /// mean and variance between the bounds; for unbounded ones, the uniform distribution.
    Jacobi,
    /// Polynomials that are orthonormal under the design itself, by the Stieltjes procedure if they have no closed
    /// form. A distribution with few moments (`student_t`, `inverse_gamma`) has few of them.
    Arbitrary,
}

impl Family {
    /// Returns the name of the family in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Legendre => "legendre",
            Self::Hermite => "hermite",
            Self::Laguerre => "laguerre",
            Self::Jacobi => "jacobi",
            Self::Arbitrary => "arbitrary",
        }
    }

    /// Returns the family itself, or that of a design for [`Family::Auto`].
    pub fn of(self, design: &Distribution) -> Self {
        match (self, design) {
            (Self::Auto, Distribution::Uniform(_)) => Self::Legendre,
            (Self::Auto, Distribution::Normal(_)) => Self::Hermite,
            (Self::Auto, Distribution::Exponential(_) | Distribution::Gamma(_)) => Self::Laguerre,
            (Self::Auto, Distribution::Beta(_)) => Self::Jacobi,
            (Self::Auto, _) => Self::Arbitrary,
            (family, _) => family,
        }
    }

    /// Returns the factor under which the derivatives of the polynomials are orthogonal too (Szego, *Orthogonal
    /// Polynomials* (1939), 4.21 and 5.1), at a value of the standard variable; 1 for polynomials without such a factor.
    pub fn slope_weight(self, z: f64) -> f64 {
        match self {
            Self::Legendre | Self::Jacobi => (1.0 - z * z).max(0.0).sqrt(),
            Self::Laguerre => z.max(0.0).sqrt(),
            Self::Auto | Self::Hermite | Self::Arbitrary => 1.0,
        }
    }

    /// Returns the weights of the product of two polynomials in the family,
    /// `psi_m psi_n = sum_r weights[r] psi_{m + n - 2 r}` with `r` from 0 to the smaller degree; `None` if there is no
    /// such short form.
    pub fn product(self, m: usize, n: usize) -> Option<Vec<f64>> {
        match self {
            Self::Legendre => Some(legendre_product(m, n)),
            Self::Hermite => Some(hermite_product(m, n)),
            _ => None,
        }
    }

    /// Returns the largest size of the standard variable for which sums of products are formed: beyond it the largest
    /// polynomials are so large that their rounding errors would exceed the sum.
    pub fn reach(self) -> f64 {
        match self {
            // Values at the bounds return from physical units with rounding errors.
            Self::Legendre => 1.0 + 1e-9,
            Self::Hermite => 3.0,
            _ => 0.0,
        }
    }
}

/// Computes `sqrt(2 n + 1) P_n(z)` by the three-term recurrence (Abramowitz and Stegun 22.7.10).
pub(super) fn legendre(z: f64, values: &mut [f64]) {
    legendre_raw(z, values);
    normalise(values);
}

/// Like [`legendre`], at several values side by side and with the same bits.
pub(super) fn legendre_lanes(z: &Lanes, table: &mut [Lanes]) {
    for n in 0..table.len() {
        table[n] = match n {
            0 => [1.0; LANES],
            1 => *z,
            _ => {
                let m = n as f64;
                let (last, before) = (table[n - 1], table[n - 2]);
                std::array::from_fn(|l| {
                    ((2.0 * m - 1.0) * z[l] * last[l] - (m - 1.0) * before[l]) / m
                })
            }
        };
    }
    for (n, row) in table.iter_mut().enumerate() {
        let size = ((2 * n + 1) as f64).sqrt();
        for value in row {
            *value *= size;
        }
    }
}

/// Computes also the derivatives, by `P'_{n+1} = P'_{n-1} + (2 n + 1) P_n`, which is valid at the ends too.
pub(super) fn legendre_derivatives(z: f64, values: &mut [f64], derivatives: &mut [f64]) {
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

/// Feldheim (1940): `He_m He_n = sum_r r! C(m, r) C(n, r) He_{m+n-2r}`, here normalised to length one.
fn hermite_product(m: usize, n: usize) -> Vec<f64> {
    let ln_factorial = |k: usize| ln_gamma(k as f64 + 1.0);
    let weight = |r: usize| {
        let lengths = ln_factorial(m) + ln_factorial(n) + ln_factorial(m + n - 2 * r);
        (0.5 * lengths - ln_factorial(r) - ln_factorial(m - r) - ln_factorial(n - r)).exp()
    };
    (0..=m.min(n)).map(weight).collect()
}

fn normalise(values: &mut [f64]) {
    for (n, value) in values.iter_mut().enumerate() {
        *value *= ((2 * n + 1) as f64).sqrt();
    }
}

//! Standard variable and polynomials of one parameter.

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna_linalg::lanes::{LANES, Lanes};
use serde::{Deserialize, Serialize};

use super::family::{Family, legendre, legendre_derivatives, legendre_lanes};
use super::measure;
use super::recurrence::Recurrence;

/// Standard variable `z` of one parameter and the polynomials in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    family: Family,
    map: Map,
    /// Recurrence of the polynomials; empty for Legendre polynomials, which have code of their own.
    recurrence: Recurrence,
}

/// Map from the parameter `x` to its standard variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Map {
    /// `z = (x - centre) / scale`.
    Affine { centre: f64, scale: f64 },
    /// `z = (ln x - centre) / scale`, limited to `bound` in size.
    Logarithm { centre: f64, scale: f64, bound: f64 },
    /// `z = F_standard^-1(F_design(x))`.
    Probability { design: Distribution, standard: Distribution },
}

/// Smallest distance of the probabilities of a transformed parameter from 0 and 1.
const EXTREME: f64 = 1e-15;
/// Value that a standard normal variable exceeds with about that probability.
const EXTREME_NORMAL: f64 = 8.0;

impl Coordinate {
    /// Returns the coordinate of a parameter for polynomials up to `degree`, or a description of why there is none.
    pub fn new(family: Family, parameter: &Parameter, degree: usize) -> Result<Self, String> {
        let (name, design) = (&parameter.name, &parameter.design);
        design.check().map_err(|fault| format!("the design of parameter `{name}`: {fault}"))?;
        let coordinate = match family.of(design) {
            Family::Hermite => Self::hermite(design, degree),
            Family::Laguerre => Self::laguerre(design, degree),
            Family::Jacobi => Self::jacobi(design, degree),
            Family::Arbitrary => Self::arbitrary(design, degree)
                .map_err(|fault| format!("the design of parameter `{name}` {fault}"))?,
            Family::Auto | Family::Legendre => Self::of_uniform(design),
        };
        let numbers = coordinate.recurrence.sizes.iter().chain(&coordinate.recurrence.centres);
        if numbers.into_iter().any(|x| !x.is_finite()) || coordinate.recurrence.sizes.contains(&0.0)
        {
            return Err(format!(
                "the polynomials of the design of parameter `{name}` ({design}) cannot be found up to \
                 degree {degree}"
            ));
        }
        Ok(coordinate)
    }

    /// Returns the coordinate of Legendre polynomials in `(x - centre) / scale`.
    pub fn legendre(centre: f64, scale: f64) -> Self {
        let map = Map::Affine { centre, scale };
        Self { family: Family::Legendre, map, recurrence: Recurrence::default() }
    }

    fn of_uniform(design: &Distribution) -> Self {
        match *design {
            Distribution::Uniform([low, high]) => {
                Self::legendre(0.5 * (low + high), 0.5 * (high - low))
            }
            Distribution::LogUniform([low, high]) => {
                let (low, high) = (low.ln(), high.ln());
                let (centre, scale) = (0.5 * (low + high), 0.5 * (high - low));
                let map = Map::Logarithm { centre, scale, bound: 1.0 };
                Self { family: Family::Legendre, map, recurrence: Recurrence::default() }
            }
            _ => Self {
                family: Family::Legendre,
                map: Map::to(design, Distribution::Uniform([-1.0, 1.0])),
                recurrence: Recurrence::default(),
            },
        }
    }

    fn hermite(design: &Distribution, degree: usize) -> Self {
        let map = match *design {
            Distribution::Normal([centre, scale]) => Map::Affine { centre, scale },
            Distribution::LogNormal([centre, scale]) => {
                Map::Logarithm { centre, scale, bound: EXTREME_NORMAL }
            }
            _ => Map::to(design, Distribution::Normal([0.0, 1.0])),
        };
        // Products of two polynomials have twice the degree.
        Self { family: Family::Hermite, map, recurrence: Recurrence::hermite(2 * degree) }
    }

    fn laguerre(design: &Distribution, degree: usize) -> Self {
        let (shape, map) = match *design {
            Distribution::Gamma([shape, scale]) => (shape, Map::Affine { centre: 0.0, scale }),
            Distribution::Exponential(scale) => (1.0, Map::Affine { centre: 0.0, scale }),
            _ => {
                let matched = (design.mean() - design.support().0).powi(2) / design.variance();
                let shape = if matched > 0.0 && matched.is_finite() { matched } else { 1.0 };
                (shape, Map::to(design, Distribution::Gamma([shape, 1.0])))
            }
        };
        Self { family: Family::Laguerre, map, recurrence: Recurrence::laguerre(degree, shape) }
    }

    fn jacobi(design: &Distribution, degree: usize) -> Self {
        let (a, b, map) = match *design {
            Distribution::Beta([a, b, low, high]) => (a, b, Map::between(low, high)),
            Distribution::Uniform([low, high]) => (1.0, 1.0, Map::between(low, high)),
            _ => {
                let [a, b] = matched_beta(design).unwrap_or([1.0, 1.0]);
                (a, b, Map::to(design, Distribution::Beta([a, b, -1.0, 1.0])))
            }
        };
        Self { family: Family::Jacobi, map, recurrence: Recurrence::jacobi(degree, a, b) }
    }

    fn arbitrary(design: &Distribution, degree: usize) -> Result<Self, String> {
        if let Some(largest) = measure::largest_degree(design).filter(|&most| most < degree) {
            return Err(format!(
                "({design}) has orthogonal polynomials up to degree {largest} only, not {degree}"
            ));
        }
        let closed = match *design {
            Distribution::Uniform([low, high]) => {
                Some((Map::between(low, high), Recurrence::legendre(degree)))
            }
            Distribution::LogNormal([mu, sigma]) => Some((
                Map::Affine { centre: 0.0, scale: mu.exp() },
                Recurrence::stieltjes_wigert(degree, sigma),
            )),
            Distribution::Normal(_) => Some(Self::hermite(design, degree).parts()),
            Distribution::Gamma(_) | Distribution::Exponential(_) => {
                Some(Self::laguerre(design, degree).parts())
            }
            Distribution::Beta(_) => Some(Self::jacobi(design, degree).parts()),
            _ => None,
        };
        let (map, recurrence) = closed.unwrap_or_else(|| {
            let (centre, scale) = (design.mean(), design.sd());
            let recurrence = measure::recurrence(design, degree, centre, scale);
            (Map::Affine { centre, scale }, recurrence)
        });
        Ok(Self { family: Family::Arbitrary, map, recurrence })
    }

    fn parts(self) -> (Map, Recurrence) {
        (self.map, self.recurrence)
    }

    /// Returns the standard variable in closed form: 1 for a logarithm or else 0, centre, scale, and bound.
    ///
    /// # Errors
    /// The reason if it is that of a transformed distribution.
    pub fn closed(&self) -> Result<[f64; 4], String> {
        match &self.map {
            Map::Affine { centre, scale } => Ok([0.0, *centre, *scale, f64::INFINITY]),
            Map::Logarithm { centre, scale, bound } => Ok([1.0, *centre, *scale, *bound]),
            Map::Probability { design, .. } => Err(format!(
                "{} polynomials of a parameter with the design {design} are those of a transformed variable; with \
                 `basis = \"auto\"` they are not",
                self.family.name()
            )),
        }
    }

    /// Returns the family of the polynomials.
    pub fn family(&self) -> Family {
        self.family
    }

    /// Returns the recurrence of the polynomials, at least up to `degree`.
    pub fn recurrence(&self, degree: usize) -> Recurrence {
        if self.family == Family::Legendre {
            Recurrence::legendre(degree)
        } else {
            self.recurrence.clone()
        }
    }

    /// Returns true if the polynomials are available up to this degree.
    pub fn reaches(&self, degree: usize) -> bool {
        self.family == Family::Legendre || degree <= self.recurrence.degree()
    }

    /// Returns the standard variable at a value of the parameter.
    pub fn standard(&self, x: f64) -> f64 {
        match &self.map {
            Map::Affine { centre, scale } => (x - centre) / scale,
            Map::Logarithm { centre, scale, bound } => {
                ((x.max(0.0).ln() - centre) / scale).clamp(-bound, *bound)
            }
            Map::Probability { design, standard } => {
                standard.quantile(design.cdf(x).clamp(EXTREME, 1.0 - EXTREME))
            }
        }
    }

    /// Returns the value of the parameter at a standard variable.
    pub fn parameter(&self, z: f64) -> f64 {
        match &self.map {
            Map::Affine { centre, scale } => centre + z * scale,
            Map::Logarithm { centre, scale, .. } => (centre + z * scale).exp(),
            Map::Probability { design, standard } => design.quantile(standard.cdf(z)),
        }
    }

    /// Returns `dx/dz` at a value of the parameter; infinite where the standard variable is constant.
    pub fn stretch(&self, x: f64) -> f64 {
        match &self.map {
            Map::Affine { scale, .. } => *scale,
            Map::Logarithm { scale, bound, .. } => {
                if self.standard(x).abs() < *bound {
                    scale * x
                } else {
                    f64::INFINITY
                }
            }
            Map::Probability { design, standard } => {
                let p = design.cdf(x);
                if (EXTREME..=1.0 - EXTREME).contains(&p) {
                    let z = standard.quantile(p);
                    (standard.log_density(z) - design.log_density(x)).exp()
                } else {
                    f64::INFINITY
                }
            }
        }
    }

    /// Returns true if sums of products are accurate at a value of the parameter.
    pub fn covers(&self, x: f64) -> bool {
        self.standard(x).abs() <= self.family.reach()
    }

    /// Computes the polynomials of degree `0..table.len()` at several values of the parameter side by side.
    pub fn values(&self, parameter: impl Iterator<Item = f64>, table: &mut [Lanes]) {
        if self.family == Family::Legendre {
            let mut z = [0.0; LANES];
            for (z, x) in z.iter_mut().zip(parameter) {
                *z = self.standard(x);
            }
            legendre_lanes(&z, table);
            return;
        }
        let mut values = vec![0.0; table.len()];
        for (l, x) in parameter.enumerate() {
            self.polynomials(self.standard(x), &mut values);
            for (entry, value) in table.iter_mut().zip(&values) {
                entry[l] = *value;
            }
        }
    }

    /// Computes the polynomials of degree `0..values.len()` at a standard variable.
    pub fn polynomials(&self, z: f64, values: &mut [f64]) {
        if self.family == Family::Legendre {
            legendre(z, values);
        } else {
            self.recurrence.values(z, values);
        }
    }

    /// Computes the polynomials and their derivatives with respect to the standard variable.
    pub fn derivatives(&self, z: f64, values: &mut [f64], derivatives: &mut [f64]) {
        if self.family == Family::Legendre {
            legendre_derivatives(z, values, derivatives);
        } else {
            self.recurrence.derivatives(z, values, derivatives);
        }
    }
}

impl Map {
    /// Maps the interval onto (-1, 1).
    fn between(low: f64, high: f64) -> Self {
        Self::Affine { centre: 0.5 * (low + high), scale: 0.5 * (high - low) }
    }

    fn to(design: &Distribution, standard: Distribution) -> Self {
        // The file format cannot hold infinite numbers.
        let design = match *design {
            Distribution::TruncatedNormal([mean, sd, low, high]) => {
                Distribution::TruncatedNormal([mean, sd, low.max(f64::MIN), high.min(f64::MAX)])
            }
            _ => design.clone(),
        };
        Self::Probability { design, standard }
    }
}

/// Returns the shapes of the beta distribution with the mean and variance of a bounded distribution, on the same
/// interval.
fn matched_beta(design: &Distribution) -> Option<[f64; 2]> {
    let (low, high) = design.support();
    let (mean, spread) = ((design.mean() - low) / (high - low), design.variance());
    let variance = spread / (high - low).powi(2);
    let sum = mean * (1.0 - mean) / variance - 1.0;
    let shapes = [mean * sum, (1.0 - mean) * sum];
    shapes.iter().all(|s| s.is_finite() && *s > 0.0).then_some(shapes)
}

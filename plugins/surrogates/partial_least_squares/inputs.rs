//! Parameters as independent variables of mean zero and variance one, and directions among them.

use lacuna::data::{Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

use crate::surrogates::polynomial_chaos::{Coordinate, Family};

/// A parameter on a scale with mean zero and variance one under its design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Input {
    coordinate: Coordinate,
    mean: f64,
    sd: f64,
    /// Bounds on that scale, if the design is bounded.
    bounds: Option<[f64; 2]>,
}

impl Input {
    /// Returns the scale of a parameter, or a description of why there is none.
    ///
    /// The scale is linear for bounded and normal designs, logarithmic for log-uniform and log-normal ones, and for all
    /// other unbounded designs the normal score.
    pub fn of(parameter: &Parameter) -> Result<Self, String> {
        let design = &parameter.design;
        let (low, high) = design.support();
        let bounded = low.is_finite() && high.is_finite();
        let family = match design {
            Distribution::Uniform(_) | Distribution::LogUniform(_) => Family::Legendre,
            _ if bounded => Family::Auto,
            _ => Family::Hermite,
        };
        let coordinate = Coordinate::new(family, parameter, 2)?;
        let (mean, sd, ends) = match (design, family) {
            (_, Family::Legendre) => (0.0, 1.0 / 3.0_f64.sqrt(), Some([-1.0, 1.0])),
            (_, Family::Hermite) => (0.0, 1.0, None),
            _ => {
                let mean = coordinate.standard(design.mean());
                let sd = (coordinate.standard(design.mean() + design.sd()) - mean).abs();
                (mean, sd, Some([coordinate.standard(low), coordinate.standard(high)]))
            }
        };
        if !(sd > 0.0 && sd.is_finite() && mean.is_finite()) {
            return Err(format!(
                "the design of parameter `{}`, {design}, has no width",
                parameter.name
            ));
        }
        let bounds = ends.map(|ends| ends.map(|z| (z - mean) / sd));
        Ok(Self { coordinate, mean, sd, bounds })
    }

    fn at(&self, x: f64) -> f64 {
        (self.coordinate.standard(x) - self.mean) / self.sd
    }

    /// Returns the derivative with respect to the parameter.
    pub fn slope(&self, x: f64) -> f64 {
        (self.sd * self.coordinate.stretch(x)).recip()
    }

    /// Returns false if damaged bytes gave it numbers that it cannot have.
    pub fn is_sound(&self) -> bool {
        self.sd > 0.0 && self.sd.is_finite() && self.mean.is_finite()
    }
}

/// Returns points (one per row, in physical units) on the scales of the inputs.
pub(super) fn scaled(inputs: &[Input], points: &Matrix) -> Matrix {
    Matrix::from_fn(points.rows(), inputs.len(), |i, j| inputs[j].at(points[(i, j)]))
}

/// Returns the positions of scaled points along directions (`inputs x directions`).
pub(super) fn positions(scaled: &Matrix, directions: &Matrix) -> Matrix {
    let columns = directions.transposed();
    Matrix::from_fn(scaled.rows(), columns.rows(), |i, j| dot(scaled.row(i), columns.row(j)))
}

/// Returns the position along each direction as a parameter of its own.
///
/// A direction of unit length has mean zero and variance one. If all of its inputs are bounded, its design is the beta
/// distribution with these moments and the bounds of the sum, which is exact for a single uniform input and tends to the
/// normal distribution for many; otherwise it is the normal distribution, exact for normal inputs.
pub(super) fn along(inputs: &[Input], directions: &Matrix) -> Vec<Parameter> {
    let parameter = |j: usize| {
        let mut ends = Some([0.0, 0.0]);
        for (i, input) in inputs.iter().enumerate() {
            let weight = directions[(i, j)];
            ends = match (ends, input.bounds) {
                (Some([low, high]), Some([a, b])) => {
                    let (a, b) = (weight * a, weight * b);
                    Some([low + a.min(b), high + a.max(b)])
                }
                (ends, None) if weight == 0.0 => ends,
                _ => None,
            };
        }
        let design = ends.and_then(matched_beta).unwrap_or(Distribution::Normal([0.0, 1.0]));
        let name = format!("direction {}", j + 1);
        Parameter {
            symbol: name.clone(),
            name,
            unit: Unit::dimensionless(),
            prior: design.clone(),
            design,
            reference: None,
        }
    };
    (0..directions.columns()).map(parameter).collect()
}

/// Returns the beta distribution between these bounds with mean zero and variance one, if there is one.
fn matched_beta([low, high]: [f64; 2]) -> Option<Distribution> {
    let range = high - low;
    let mean = -low / range;
    let sum = mean * (1.0 - mean) * range * range - 1.0;
    let shapes = [mean * sum, (1.0 - mean) * sum];
    let sound = shapes.iter().all(|s| s.is_finite() && *s > 0.0);
    sound.then_some(Distribution::Beta([shapes[0], shapes[1], low, high]))
}

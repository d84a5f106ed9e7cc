//! Parameters of any unit and size on a common scale.

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

/// Standard variable `z = (x - centre) / width` of a parameter: 0 at the median of its design, and 1 the range of a
/// uniform design. For log-uniform and log-normal designs `x` is the logarithm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Standard {
    centre: f64,
    width: f64,
    logarithm: bool,
}

impl Standard {
    /// Returns the standard variable of a parameter, or a description of why there is none.
    pub fn of(parameter: &Parameter) -> Result<Self, String> {
        let design = &parameter.design;
        let logarithm = matches!(design, Distribution::LogUniform(_) | Distribution::LogNormal(_));
        let measured = |p: f64| {
            let x = design.quantile(p);
            if logarithm { x.ln() } else { x }
        };
        // Between these quantiles lie 0.8 of the range of a uniform distribution.
        let width = (measured(0.9) - measured(0.1)) / 0.8;
        let standard = Self { centre: measured(0.5), width, logarithm };
        if width > 0.0 && width.is_finite() && standard.centre.is_finite() {
            return Ok(standard);
        }
        Err(format!("the design of parameter `{}`, {design}, has no width", parameter.name))
    }

    /// Returns 1 if `x` is a logarithm and 0 otherwise, the centre, and the width.
    pub fn closed(&self) -> [f64; 3] {
        [f64::from(u8::from(self.logarithm)), self.centre, self.width]
    }

    /// Returns the standard variable at a value of the parameter.
    pub fn at(&self, x: f64) -> f64 {
        // Values outside the support of a positive distribution are replaced by the smallest positive number.
        let measured = if self.logarithm { x.max(f64::MIN_POSITIVE).ln() } else { x };
        (measured - self.centre) / self.width
    }

    /// Returns the derivative of the standard variable with respect to the parameter.
    pub fn slope(&self, x: f64) -> f64 {
        match self.logarithm {
            true if x > f64::MIN_POSITIVE => 1.0 / (x * self.width),
            true => 0.0,
            false => 1.0 / self.width,
        }
    }

    /// Returns true if `x` lies in the range of the standard variable: a logarithmic one needs `x > 0`.
    pub fn covers(&self, x: f64) -> bool {
        !self.logarithm || x > 0.0
    }
}

/// Returns the standard variables of points (one per row) as a matrix with one point per column
/// (`parameters x points`).
pub fn standardised(standards: &[Standard], points: &Matrix) -> Matrix {
    Matrix::from_fn(standards.len(), points.rows(), |k, i| standards[k].at(points[(i, k)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::Unit;

    fn parameter(design: Distribution) -> Parameter {
        let prior = design.clone();
        let (name, symbol) = ("a".to_owned(), "a".to_owned());
        Parameter { name, symbol, unit: Unit::dimensionless(), design, prior, reference: None }
    }

    #[test]
    fn a_uniform_design_has_the_width_one() {
        let standard = Standard::of(&parameter(Distribution::Uniform([2e4, 6e4]))).unwrap();
        assert!((standard.at(2e4) + 0.5).abs() < 1e-14 && (standard.at(6e4) - 0.5).abs() < 1e-14);
        let decades = Standard::of(&parameter(Distribution::LogUniform([1e-6, 1e2]))).unwrap();
        assert!((decades.at(1e-6) + 0.5).abs() < 1e-12 && decades.at(1e-2).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_differences() {
        for law in [
            Distribution::Uniform([-1.0, 3.0]),
            Distribution::LogNormal([0.3, 2.0]),
            Distribution::StudentT([1.5, 0.0, 2.0]),
        ] {
            let standard = Standard::of(&parameter(law)).unwrap();
            let difference = (standard.at(1.2 + 1e-6) - standard.at(1.2 - 1e-6)) / 2e-6;
            assert!((standard.slope(1.2) - difference).abs() < 1e-8);
        }
    }
}

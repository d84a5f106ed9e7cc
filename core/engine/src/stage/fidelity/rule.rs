//! Rules that relate the fine response to the cheap one.

use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

/// Parts of `y(x) = scale * c(x) + difference(x)` that are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rule {
    /// Factor of the cheap response.
    pub scale: Scale,
    /// Form of the difference.
    pub difference: Shape,
}

/// Factor of the cheap response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// The cheap response is not used.
    Zero,
    /// Factor one.
    One,
    /// Regression of the fine responses of a group on the cheap ones.
    Regressed,
}

/// Form of the difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// No difference.
    Nothing,
    /// One constant per output.
    Constant,
    /// An emulator.
    Emulated,
}

impl Rule {
    /// The cheap response unchanged.
    pub const SAME: Self = Self { scale: Scale::One, difference: Shape::Nothing };
    /// The emulator of the fine runs alone.
    pub const ALONE: Self = Self { scale: Scale::Zero, difference: Shape::Emulated };
    /// The cheap response and the mean difference.
    pub const SHIFTED: Self = Self { scale: Scale::One, difference: Shape::Constant };
    /// A multiple of the cheap response and a constant.
    pub const SCALED: Self = Self { scale: Scale::Regressed, difference: Shape::Constant };
    /// The cheap response and an emulator of the difference.
    pub const DIFFERENCE: Self = Self { scale: Scale::One, difference: Shape::Emulated };
    /// A multiple of the cheap response and an emulator of the rest.
    pub const BOTH: Self = Self { scale: Scale::Regressed, difference: Shape::Emulated };

    /// Rules for a correction of the cheap response, which is used unchanged if none is better.
    pub const OF_CORRECTION: [Self; 4] = [Self::SAME, Self::SHIFTED, Self::DIFFERENCE, Self::BOTH];
    /// Rules for an emulator of the fine runs, which is fitted to them alone if none is better.
    pub const OF_ENSEMBLES: [Self; 5] =
        [Self::ALONE, Self::SHIFTED, Self::SCALED, Self::DIFFERENCE, Self::BOTH];

    /// Description of the rule.
    pub fn words(self) -> &'static str {
        match (self.scale, self.difference) {
            (Scale::Zero, _) => "fine runs alone",
            (Scale::One, Shape::Nothing) => "no correction",
            (Scale::One, Shape::Constant) => "mean difference",
            (Scale::One, Shape::Emulated) => "emulated difference",
            (Scale::Regressed, Shape::Emulated) => "scaled cheap response and emulated difference",
            (Scale::Regressed, _) => "scaled cheap response and mean difference",
        }
    }
}

/// Regression of the fine responses on the cheap ones, both after removal of low-order functions of the parameters.
pub(super) struct Regression {
    /// Orthonormal columns over the runs, one per removed function.
    removed: Vec<Vec<f64>>,
}

impl Regression {
    /// Removes constants and, for `linear`, linear functions of the points.
    ///
    /// The difference represents smooth functions of the parameters, so these must not influence the factor: this is
    /// generalised least squares in the limit of a linear difference of unknown size.
    pub fn new(points: &Matrix, linear: bool) -> Self {
        let mut regression = Self { removed: Vec::new() };
        regression.remove(vec![1.0; points.rows()]);
        if linear {
            (0..points.columns()).for_each(|j| regression.remove(points.column(j)));
        }
        regression
    }

    fn remove(&mut self, column: Vec<f64>) {
        let before = dot(&column, &column).sqrt();
        let rest = self.rest(column);
        let norm = dot(&rest, &rest).sqrt();
        // A column that depends on the earlier ones leaves only round-off, which must not count as a direction.
        if norm > 1e-8 * before {
            self.removed.push(rest.into_iter().map(|x| x / norm).collect());
        }
    }

    /// Residual of a column; the projection is applied twice to reduce round-off.
    fn rest(&self, mut column: Vec<f64>) -> Vec<f64> {
        for _ in 0..2 {
            for q in &self.removed {
                let along = dot(q, &column);
                column.iter_mut().zip(q).for_each(|(x, q)| *x -= along * q);
            }
        }
        column
    }

    /// Factor of a group of outputs; one if the cheap response is constant.
    pub fn factor(&self, fine: &Matrix, cheap: &Matrix, outputs: &[usize]) -> f64 {
        let (mut product, mut square, mut whole) = (0.0, 0.0, 0.0);
        for &j in outputs {
            let cheap = cheap.column(j);
            whole += dot(&cheap, &cheap);
            let (cheap, fine) = (self.rest(cheap), self.rest(fine.column(j)));
            product += dot(&cheap, &fine);
            square += dot(&cheap, &cheap);
        }
        if square > 1e-20 * whole { product / square } else { 1.0 }
    }
}

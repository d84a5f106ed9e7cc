//! How the fine response may follow from the cheap one.

use serde::{Deserialize, Serialize};

use crate::linalg::Matrix;
use crate::linalg::vector::dot;

/// `y(x) = scale * c(x) + difference(x)`: what is estimated of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rule {
    /// The factor of the cheap response.
    pub scale: Scale,
    /// The difference.
    pub difference: Shape,
}

/// The factor of the cheap response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// The cheap response is not used.
    Zero,
    /// One.
    One,
    /// By regression of the fine responses of a group on the cheap ones.
    Regressed,
}

/// The difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// None.
    Nothing,
    /// One number an output.
    Constant,
    /// An emulator.
    Emulated,
}

impl Rule {
    /// The cheap response as it is.
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

    /// The rules for a correction of the cheap response, which is what counts when none is better.
    pub const OF_CORRECTION: [Self; 4] = [Self::SAME, Self::SHIFTED, Self::DIFFERENCE, Self::BOTH];
    /// The rules for an emulator of the fine runs, which is made of them alone when none is better.
    pub const OF_ENSEMBLES: [Self; 5] =
        [Self::ALONE, Self::SHIFTED, Self::SCALED, Self::DIFFERENCE, Self::BOTH];

    /// What it is, in words.
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

/// The regression of the fine responses on the cheap ones, both without what a function of the parameters of lower order
/// explains.
pub(super) struct Regression {
    /// Orthonormal columns, one a function, over the runs.
    removed: Vec<Vec<f64>>,
}

impl Regression {
    /// Without constants, and for `linear` without linear functions of the points.
    ///
    /// The difference takes up smooth functions of the parameters, so that they must not decide upon the factor: this is
    /// generalised least squares in the limit of a difference that is linear and of unknown size.
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
        if norm > 1e-8 * before {
            self.removed.push(rest.into_iter().map(|x| x / norm).collect());
        }
    }

    /// What is left of a column; twice, for the sake of round-off.
    fn rest(&self, mut column: Vec<f64>) -> Vec<f64> {
        for _ in 0..2 {
            for q in &self.removed {
                let along = dot(q, &column);
                column.iter_mut().zip(q).for_each(|(x, q)| *x -= along * q);
            }
        }
        column
    }

    /// The factor of a group of outputs; one where the cheap response does not vary.
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

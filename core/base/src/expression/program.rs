//! Compiled expressions: a short list of instructions on numbered registers.

use std::sync::Arc;

use super::curve::Curve;
use super::function::Reduction;
use super::operator::{Binary, Lanes, Unary};
use super::{forward, reverse, tangent};
use crate::matrix::Matrix;

/// Number of points that are evaluated together.
pub(super) const WIDE: usize = 8;

/// Compiled definitions, ready to be evaluated at many points; made by [`Scope::compile`](super::Scope::compile).
///
/// Points hold the unknowns in the order of their declaration; results hold the outputs concatenated, with the elements
/// of a vector side by side. A result depends on its point alone: not on the other points of a batch, nor on the number
/// of threads.
#[derive(Clone, Debug)]
pub struct Program {
    pub(super) instructions: Vec<Instruction>,
    pub(super) tables: Tables,
    pub(super) unknowns: usize,
    /// Numbers of the expressions and of the data; places of constants point into it.
    pub(super) constants: Vec<Lanes<1>>,
    /// Like `constants`, repeated for each lane.
    pub(super) wide_constants: Vec<Lanes<WIDE>>,
    /// Number of registers; those of the unknowns come first.
    pub(super) registers: usize,
    pub(super) outputs: Vec<Place>,
}

/// One instruction: what is computed, and the registers of the result.
#[derive(Clone, Debug)]
pub(super) struct Instruction {
    pub action: Action,
    /// First register of the result; every argument lies before it.
    pub start: usize,
    pub length: usize,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Action {
    Unary(Unary, Place),
    Binary(Binary, Place, Place),
    /// Condition, yes, no.
    Select(Place, Place, Place),
    Reduce(Reduction, Place),
    /// Elements selected by `Tables::indices`.
    Gather(Place, usize),
    Join(Vec<Place>),
    /// Product with one of `Tables::matrices`.
    MatrixProduct(usize, Place),
    /// Start, factor, input: each element is the factor times the preceding element, plus the input.
    Recurrence(Place, Place, Place),
    /// Interpolated value of one of `Tables::curves`.
    Interpolate(usize, Place),
}

/// Registers or constants that hold the elements of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub constant: bool,
    pub start: usize,
    pub length: usize,
}

/// Data that instructions refer to by index.
#[derive(Clone, Debug, Default)]
pub(super) struct Tables {
    pub indices: Vec<Vec<usize>>,
    pub matrices: Vec<Matrix>,
    /// Shared, because tables may be long and the programs of one scope use the same ones.
    pub curves: Vec<Arc<Curve>>,
}

impl Place {
    pub fn range(self) -> std::ops::Range<usize> {
        self.start..self.start + self.length
    }
}

impl Action {
    /// Places of the arguments.
    pub fn places(&self) -> Vec<Place> {
        match self {
            Self::Unary(_, a)
            | Self::Reduce(_, a)
            | Self::Gather(a, _)
            | Self::MatrixProduct(_, a)
            | Self::Interpolate(_, a) => vec![*a],
            Self::Binary(_, a, b) => vec![*a, *b],
            Self::Select(a, b, c) | Self::Recurrence(a, b, c) => vec![*a, *b, *c],
            Self::Join(parts) => parts.clone(),
        }
    }
}

impl Program {
    /// Number of unknowns: the length of a point.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Number of values at a point: the outputs, with all elements of vectors counted.
    pub fn outputs(&self) -> usize {
        self.outputs.iter().map(|place| place.length).sum()
    }

    /// Number of values of each output: 1, or the length of a vector.
    pub fn lengths(&self) -> Vec<usize> {
        self.outputs.iter().map(|place| place.length).collect()
    }

    /// Number of instructions after simplification.
    pub fn instructions(&self) -> usize {
        self.instructions.len()
    }

    /// Number of arithmetic operations per point.
    pub fn operations(&self) -> usize {
        let products = |action: &Action| match action {
            Action::Reduce(_, a) | Action::MatrixProduct(_, a) => a.length,
            _ => 1,
        };
        self.instructions.iter().map(|i| i.length * products(&i.action)).sum()
    }

    /// Returns true if any output depends on the unknown with this index.
    pub fn depends_on(&self, unknown: usize) -> bool {
        let instructions = self.instructions.iter().flat_map(|i| i.action.places());
        let mut places = instructions.chain(self.outputs.iter().copied());
        places.any(|place| !place.constant && place.range().contains(&unknown))
    }

    /// The values at one point, the outputs concatenated.
    ///
    /// # Panics
    ///
    /// If the point does not have [`Program::unknowns`] coordinates; this holds for all methods.
    pub fn value(&self, point: &[f64]) -> Vec<f64> {
        let registers = self.filled(point);
        self.each_output(&self.constants, &registers).map(|lanes| lanes[0]).collect()
    }

    /// The values at each row of `points` (`points x unknowns`), one row per point (`points x outputs`).
    pub fn values(&self, points: &Matrix) -> Matrix {
        let (count, outputs) = (points.rows(), self.outputs());
        let mut values = Matrix::zeros(count, outputs);
        let mut registers = vec![[0.0; WIDE]; self.registers];
        let whole = count - count % WIDE;
        for first in (0..whole).step_by(WIDE) {
            for l in 0..WIDE {
                let point = points.row(first + l);
                registers.iter_mut().zip(point).for_each(|(lanes, x)| lanes[l] = *x);
            }
            forward::run(self, &self.wide_constants, &mut registers);
            for (j, lanes) in self.each_output(&self.wide_constants, &registers).enumerate() {
                for (l, value) in lanes.iter().enumerate() {
                    values[(first + l, j)] = *value;
                }
            }
        }
        for i in whole..count {
            values.row_mut(i).copy_from_slice(&self.value(points.row(i)));
        }
        values
    }

    /// The first value at a point and its derivative by each unknown, for programs with one output.
    pub fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let mut weights = vec![0.0; self.outputs()];
        weights[0] = 1.0;
        let (values, gradient) = self.pull_back(point, &weights);
        (values[0], gradient)
    }

    /// The values at a point, and the gradient of their weighted sum by the unknowns (reverse mode).
    pub fn pull_back(&self, point: &[f64], weights: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let registers = self.filled(point);
        let values = self.each_output(&self.constants, &registers).map(|lanes| lanes[0]).collect();
        let mut adjoints = vec![0.0; self.registers];
        let mut weights = weights.iter();
        for place in &self.outputs {
            for (i, weight) in place.range().zip(weights.by_ref()) {
                if !place.constant {
                    adjoints[i] += weight;
                }
            }
        }
        reverse::run(self, &registers, &mut adjoints);
        adjoints.truncate(self.unknowns);
        (values, adjoints)
    }

    /// The values at a point, and their derivatives along a direction (forward mode).
    pub fn push_forward(&self, point: &[f64], direction: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let registers = self.filled(point);
        let values = self.each_output(&self.constants, &registers).map(|lanes| lanes[0]).collect();
        let mut tangents = vec![[0.0]; self.registers];
        tangents.iter_mut().zip(direction).for_each(|(tangent, x)| *tangent = [*x]);
        tangent::run(self, &registers, &mut tangents);
        let of = |place: &Place| {
            let lanes = |i: usize| if place.constant { 0.0 } else { tangents[i][0] };
            place.range().map(lanes).collect::<Vec<f64>>()
        };
        (values, self.outputs.iter().flat_map(of).collect())
    }

    /// The values at a point, and the Jacobian (`outputs x unknowns`): in reverse mode if there are fewer outputs, in
    /// forward mode if there are fewer unknowns.
    pub fn jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let (rows, columns) = (self.outputs(), self.unknowns);
        let mut jacobian = Matrix::zeros(rows, columns);
        let unit = |length: usize, i: usize| {
            let mut unit = vec![0.0; length];
            unit[i] = 1.0;
            unit
        };
        if rows <= columns {
            for i in 0..rows {
                let (_, gradient) = self.pull_back(point, &unit(rows, i));
                jacobian.row_mut(i).copy_from_slice(&gradient);
            }
        } else {
            for j in 0..columns {
                let (_, slopes) = self.push_forward(point, &unit(columns, j));
                slopes.iter().enumerate().for_each(|(i, slope)| jacobian[(i, j)] = *slope);
            }
        }
        (self.value(point), jacobian)
    }

    /// All registers evaluated at a point.
    fn filled(&self, point: &[f64]) -> Vec<Lanes<1>> {
        assert_eq!(point.len(), self.unknowns, "the coordinates of a point");
        let mut registers = vec![[0.0]; self.registers];
        registers.iter_mut().zip(point).for_each(|(lane, x)| lane[0] = *x);
        forward::run(self, &self.constants, &mut registers);
        registers
    }

    fn each_output<'a, const L: usize>(
        &'a self,
        constants: &'a [Lanes<L>],
        registers: &'a [Lanes<L>],
    ) -> impl Iterator<Item = &'a Lanes<L>> {
        self.outputs.iter().flat_map(move |place| {
            let from = if place.constant { constants } else { registers };
            &from[place.range()]
        })
    }
}

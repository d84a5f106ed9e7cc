//! Derivatives in reverse mode, from the outputs back to the unknowns.
//!
//! A. Griewank and A. Walther, Evaluating Derivatives, 2nd edition, SIAM 2008, chapter 3. A zero adjoint contributes
//! nothing and a zero slope receives nothing, whatever the other factor: the branch of an `if` that is not taken may be
//! undefined.

use super::function::Reduction;
use super::operator::{Lanes, Visit};
use super::program::{Action, Place, Program};
use crate::matrix::Matrix;

/// Adds the adjoints of the outputs, propagated back, to the adjoints of the unknowns.
pub(super) fn run(program: &Program, registers: &[Lanes<1>], adjoints: &mut [f64]) {
    for instruction in program.instructions.iter().rev() {
        let (before, rest) = adjoints.split_at_mut(instruction.start);
        let weights = &rest[..instruction.length];
        if weights.iter().all(|w| *w == 0.0) {
            continue;
        }
        let result = &registers[instruction.start..instruction.start + instruction.length];
        Step { program, registers, result, weights }.pull(&instruction.action, before);
    }
}

/// One instruction in the backward pass.
struct Step<'a> {
    program: &'a Program,
    registers: &'a [Lanes<1>],
    result: &'a [Lanes<1>],
    weights: &'a [f64],
}

/// Adds weights times a derivative to the adjoints of one argument.
struct Pull<'a> {
    a: &'a [Lanes<1>],
    b: &'a [Lanes<1>],
    result: &'a [Lanes<1>],
    weights: &'a [f64],
    into: &'a mut [f64],
}

impl Visit for Pull<'_> {
    fn visit(self, slope: impl Fn(f64, f64, f64) -> f64) {
        let share = |w: f64, a: f64, b: f64, z: f64| {
            let slope = slope(a, b, z);
            if w == 0.0 || slope == 0.0 { 0.0 } else { w * slope }
        };
        let results = self.weights.iter().zip(self.result);
        // An argument with one element is combined with every element of the other.
        match (self.a, self.b) {
            ([a], [b]) => pour(results.map(|(w, z)| share(*w, a[0], b[0], z[0])), self.into),
            ([a], b) => {
                let shares = results.zip(b).map(|((w, z), b)| share(*w, a[0], b[0], z[0]));
                pour(shares, self.into);
            }
            (a, [b]) => {
                let shares = results.zip(a).map(|((w, z), a)| share(*w, a[0], b[0], z[0]));
                pour(shares, self.into);
            }
            (a, b) => {
                let shares = results.zip(a).zip(b);
                pour(shares.map(|(((w, z), a), b)| share(*w, a[0], b[0], z[0])), self.into);
            }
        }
    }
}

/// Adds each contribution to its element, or all of them to a single element.
fn pour(shares: impl Iterator<Item = f64>, into: &mut [f64]) {
    if let [into] = into {
        let mut partial = [0.0; 4];
        shares.enumerate().for_each(|(i, share)| partial[i % 4] += share);
        *into += (partial[0] + partial[1]) + (partial[2] + partial[3]);
    } else {
        into.iter_mut().zip(shares).for_each(|(into, share)| *into += share);
    }
}

impl<'a> Step<'a> {
    fn get(&self, place: Place) -> &'a [Lanes<1>] {
        let from = if place.constant { &self.program.constants } else { self.registers };
        &from[place.range()]
    }

    fn pull(&self, action: &Action, adjoints: &mut [f64]) {
        match action {
            Action::Unary(operation, a) => {
                let a_values = self.get(*a);
                self.visited(*a, a_values, a_values, adjoints, |pull| operation.slope(pull));
            }
            Action::Binary(operation, a, b) => {
                let (left, right) = (self.get(*a), self.get(*b));
                self.visited(*a, left, right, adjoints, |pull| operation.left_slope(pull));
                self.visited(*b, left, right, adjoints, |pull| operation.right_slope(pull));
            }
            Action::Select(condition, yes, no) => self.select(*condition, *yes, *no, adjoints),
            Action::Reduce(reduction, a) => self.reduce(*reduction, *a, adjoints),
            Action::Gather(a, indices) => {
                let indices = &self.program.tables.indices[*indices];
                for (&i, w) in indices.iter().zip(self.weights) {
                    adjoints[a.start + i] += w;
                }
            }
            Action::Join(parts) => {
                let mut weights = self.weights.iter();
                for part in parts {
                    for (i, w) in part.range().zip(weights.by_ref()) {
                        if !part.constant {
                            adjoints[i] += w;
                        }
                    }
                }
            }
            Action::MatrixProduct(matrix, a) => {
                let matrix: &Matrix = &self.program.tables.matrices[*matrix];
                for (row, w) in matrix.iter_rows().zip(self.weights) {
                    let into = &mut adjoints[a.range()];
                    into.iter_mut().zip(row).for_each(|(into, x)| *into += w * x);
                }
            }
            Action::Recurrence(start, factor, input) => {
                self.recurrence(*start, *factor, *input, adjoints);
            }
            Action::Interpolate(curve, a) => {
                let curve = &self.program.tables.curves[*curve];
                for ((i, x), w) in a.range().zip(self.get(*a)).zip(self.weights) {
                    adjoints[i] += w * curve.segment(x[0]).slope(x[0]);
                }
            }
        }
    }

    /// Passes the adjoints of an argument that is not constant to a visitor.
    fn visited(
        &self,
        place: Place,
        a: &[Lanes<1>],
        b: &[Lanes<1>],
        adjoints: &mut [f64],
        add: impl FnOnce(Pull<'_>),
    ) {
        if !place.constant {
            let into = &mut adjoints[place.range()];
            add(Pull { a, b, result: self.result, weights: self.weights, into });
        }
    }

    fn select(&self, condition: Place, yes: Place, no: Place, adjoints: &mut [f64]) {
        let condition = self.get(condition);
        for (i, w) in self.weights.iter().enumerate() {
            let decided = condition[if condition.len() == 1 { 0 } else { i }][0];
            let chosen = if decided == 0.0 { no } else { yes };
            if !chosen.constant {
                adjoints[chosen.start + if chosen.length == 1 { 0 } else { i }] += w;
            }
        }
    }

    /// Backward pass of a recurrence: each element passes its own adjoint plus what the following element has passed on
    /// to the preceding element.
    fn recurrence(&self, start: Place, factor: Place, input: Place, adjoints: &mut [f64]) {
        let factors = self.get(factor);
        let mut add = |place: Place, i: usize, share: f64| {
            if !place.constant {
                adjoints[place.start + if place.length == 1 { 0 } else { i }] += share;
            }
        };
        let mut weight = 0.0;
        for i in (0..self.weights.len()).rev() {
            weight += self.weights[i];
            let before = if i == 0 { self.get(start)[0][0] } else { self.result[i - 1][0] };
            add(input, i, weight);
            add(factor, i, weight * before);
            weight *= factors[if factors.len() == 1 { 0 } else { i }][0];
        }
        add(start, 0, weight);
    }

    fn reduce(&self, reduction: Reduction, a: Place, adjoints: &mut [f64]) {
        let (w, total) = (self.weights[0], self.result[0][0]);
        let into = &mut adjoints[a.range()];
        let values = self.get(a);
        match reduction {
            Reduction::Sum => into.iter_mut().for_each(|into| *into += w),
            // Among equal elements the first one receives the derivative.
            Reduction::Min | Reduction::Max => {
                if let Some(i) = values.iter().position(|x| x[0] == total) {
                    into[i] += w;
                }
            }
            Reduction::LogSumExp => {
                for (into, x) in into.iter_mut().zip(values) {
                    *into += w * if x[0] == total { 1.0 } else { (x[0] - total).exp() };
                }
            }
        }
    }
}

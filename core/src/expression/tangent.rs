//! Derivatives in forward mode: from the unknowns along one direction to the outputs.

use super::function::Reduction;
use super::operator::{Lanes, Visit};
use super::program::{Action, Place, Program};

/// Fills the tangents behind those of the unknowns.
pub(super) fn run(program: &Program, registers: &[Lanes<1>], tangents: &mut [f64]) {
    for instruction in &program.instructions {
        let (before, rest) = tangents.split_at_mut(instruction.start);
        let out = &mut rest[..instruction.length];
        let result = &registers[instruction.start..instruction.start + instruction.length];
        Step { program, registers, tangents: before, result }.push(&instruction.action, out);
    }
}

/// One instruction on its way.
struct Step<'a> {
    program: &'a Program,
    registers: &'a [Lanes<1>],
    tangents: &'a [f64],
    result: &'a [Lanes<1>],
}

/// A derivative times the tangent of one argument, added to the tangent of the result.
struct Push<'a> {
    a: &'a [Lanes<1>],
    b: &'a [Lanes<1>],
    result: &'a [Lanes<1>],
    tangent: &'a [f64],
    out: &'a mut [f64],
}

impl Visit for Push<'_> {
    fn visit(self, slope: impl Fn(f64, f64, f64) -> f64) {
        for (i, out) in self.out.iter_mut().enumerate() {
            let t = self.tangent[at(self.tangent, i)];
            if t == 0.0 {
                continue;
            }
            let slope =
                slope(self.a[at(self.a, i)][0], self.b[at(self.b, i)][0], self.result[i][0]);
            if slope != 0.0 {
                *out += t * slope;
            }
        }
    }
}

/// The index of an element in a value that may have only one.
fn at<T>(values: &[T], i: usize) -> usize {
    if values.len() == 1 { 0 } else { i }
}

impl<'a> Step<'a> {
    fn get(&self, place: Place) -> &'a [Lanes<1>] {
        let from = if place.constant { &self.program.constants } else { self.registers };
        &from[place.range()]
    }

    /// The tangent of element `i`.
    fn tangent(&self, place: Place, i: usize) -> f64 {
        let i = if place.length == 1 { 0 } else { i };
        if place.constant { 0.0 } else { self.tangents[place.start + i] }
    }

    fn push(&self, action: &Action, out: &mut [f64]) {
        match action {
            Action::Unary(operation, a) => {
                let values = self.get(*a);
                self.visited(*a, values, values, out, |push| operation.slope(push));
            }
            Action::Binary(operation, a, b) => {
                let (left, right) = (self.get(*a), self.get(*b));
                self.visited(*a, left, right, out, |push| operation.left_slope(push));
                self.visited(*b, left, right, out, |push| operation.right_slope(push));
            }
            Action::Select(condition, yes, no) => {
                let condition = self.get(*condition);
                for (i, out) in out.iter_mut().enumerate() {
                    let chosen = if condition[at(condition, i)][0] == 0.0 { no } else { yes };
                    *out = self.tangent(*chosen, i);
                }
            }
            Action::Reduce(reduction, a) => out[0] = self.reduce(*reduction, *a),
            Action::Gather(a, indices) => {
                let indices = &self.program.tables.indices[*indices];
                out.iter_mut().zip(indices).for_each(|(out, &i)| *out = self.tangent(*a, i));
            }
            Action::Join(parts) => {
                let elements =
                    parts.iter().flat_map(|p| (0..p.length).map(|i| self.tangent(*p, i)));
                out.iter_mut().zip(elements).for_each(|(out, t)| *out = t);
            }
            Action::MatrixProduct(matrix, a) => {
                let rows = self.program.tables.matrices[*matrix].iter_rows();
                for (out, row) in out.iter_mut().zip(rows) {
                    *out = row.iter().enumerate().map(|(j, x)| x * self.tangent(*a, j)).sum();
                }
            }
            Action::Recurrence(start, factor, input) => {
                let factors = self.get(*factor);
                let (mut value, mut tangent) = (self.get(*start)[0][0], self.tangent(*start, 0));
                for (i, out) in out.iter_mut().enumerate() {
                    let f = factors[at(factors, i)][0];
                    tangent =
                        f * tangent + self.tangent(*factor, i) * value + self.tangent(*input, i);
                    value = self.result[i][0];
                    *out = tangent;
                }
            }
            Action::Interpolate(curve, a) => {
                let curve = &self.program.tables.curves[*curve];
                for (i, (out, x)) in out.iter_mut().zip(self.get(*a)).enumerate() {
                    let tangent = self.tangent(*a, i);
                    *out = if tangent == 0.0 { 0.0 } else { tangent * curve.segment(x[0]).2 };
                }
            }
        }
    }

    /// Hands the tangent of an argument that is not constant to what makes use of it.
    fn visited(
        &self,
        place: Place,
        a: &[Lanes<1>],
        b: &[Lanes<1>],
        out: &mut [f64],
        add: impl FnOnce(Push<'_>),
    ) {
        if !place.constant {
            let tangent = &self.tangents[place.range()];
            add(Push { a, b, result: self.result, tangent, out });
        }
    }

    fn reduce(&self, reduction: Reduction, a: Place) -> f64 {
        let (values, total) = (self.get(a), self.result[0][0]);
        let tangents = (0..a.length).map(|i| self.tangent(a, i));
        match reduction {
            Reduction::Sum => tangents.sum(),
            Reduction::Min | Reduction::Max => {
                let chosen = values.iter().position(|x| x[0] == total);
                chosen.map_or(0.0, |i| self.tangent(a, i))
            }
            Reduction::LogSumExp => {
                let share = |x: f64| if x == total { 1.0 } else { (x - total).exp() };
                tangents.zip(values).map(|(t, x)| t * share(x[0])).sum()
            }
        }
    }
}

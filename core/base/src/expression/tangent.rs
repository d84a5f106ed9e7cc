//! Derivatives in forward mode: from the unknowns to the outputs, along one direction or several at once.

use super::function::Reduction;
use super::operator::{Lanes, Visit};
use super::program::{Action, Place, Program};

/// Computes all tangents behind those of the unknowns.
pub(super) fn run<const L: usize>(
    program: &Program,
    registers: &[Lanes<1>],
    tangents: &mut [Lanes<L>],
) {
    for instruction in &program.instructions {
        let (before, rest) = tangents.split_at_mut(instruction.start);
        let out = &mut rest[..instruction.length];
        let result = &registers[instruction.start..instruction.start + instruction.length];
        Step { program, registers, tangents: before, result }.push(&instruction.action, out);
    }
}

/// One instruction in the forward pass.
struct Step<'a, const L: usize> {
    program: &'a Program,
    registers: &'a [Lanes<1>],
    tangents: &'a [Lanes<L>],
    result: &'a [Lanes<1>],
}

/// Adds a derivative times the tangent of one argument to the tangent of the result.
struct Push<'a, const L: usize> {
    a: &'a [Lanes<1>],
    b: &'a [Lanes<1>],
    result: &'a [Lanes<1>],
    tangent: &'a [Lanes<L>],
    out: &'a mut [Lanes<L>],
}

impl<const L: usize> Visit for Push<'_, L> {
    fn visit(self, slope: impl Fn(f64, f64, f64) -> f64) {
        for (i, out) in self.out.iter_mut().enumerate() {
            let t = self.tangent[at(self.tangent, i)];
            if t == [0.0; L] {
                continue;
            }
            let slope =
                slope(self.a[at(self.a, i)][0], self.b[at(self.b, i)][0], self.result[i][0]);
            if slope != 0.0 {
                for l in 0..L {
                    // A zero tangent contributes nothing, even if the slope is infinite or undefined.
                    out[l] += if t[l] == 0.0 { 0.0 } else { t[l] * slope };
                }
            }
        }
    }
}

/// Index of an element in a value that may have only one.
fn at<T>(values: &[T], i: usize) -> usize {
    if values.len() == 1 { 0 } else { i }
}

impl<'a, const L: usize> Step<'a, L> {
    fn get(&self, place: Place) -> &'a [Lanes<1>] {
        let from = if place.constant { &self.program.constants } else { self.registers };
        &from[place.range()]
    }

    /// The tangent of element `i`.
    fn tangent(&self, place: Place, i: usize) -> Lanes<L> {
        let i = if place.length == 1 { 0 } else { i };
        if place.constant { [0.0; L] } else { self.tangents[place.start + i] }
    }

    fn push(&self, action: &Action, out: &mut [Lanes<L>]) {
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
                    *out = sum(row.iter().enumerate().map(|(j, x)| times(*x, self.tangent(*a, j))));
                }
            }
            Action::Recurrence(start, factor, input) => {
                let factors = self.get(*factor);
                let (mut value, mut tangent) = (self.get(*start)[0][0], self.tangent(*start, 0));
                for (i, out) in out.iter_mut().enumerate() {
                    let f = factors[at(factors, i)][0];
                    let (by_factor, by_input) = (self.tangent(*factor, i), self.tangent(*input, i));
                    for l in 0..L {
                        tangent[l] = f * tangent[l] + by_factor[l] * value + by_input[l];
                    }
                    value = self.result[i][0];
                    *out = tangent;
                }
            }
            Action::Interpolate(curve, a) => {
                let curve = &self.program.tables.curves[*curve];
                for (i, (out, x)) in out.iter_mut().zip(self.get(*a)).enumerate() {
                    let tangent = self.tangent(*a, i);
                    if tangent != [0.0; L] {
                        *out = times(curve.segment(x[0]).slope(x[0]), tangent);
                    }
                }
            }
        }
    }

    /// Passes the tangent of an argument that is not constant to a visitor.
    fn visited(
        &self,
        place: Place,
        a: &[Lanes<1>],
        b: &[Lanes<1>],
        out: &mut [Lanes<L>],
        add: impl FnOnce(Push<'_, L>),
    ) {
        if !place.constant {
            let tangent = &self.tangents[place.range()];
            add(Push { a, b, result: self.result, tangent, out });
        }
    }

    fn reduce(&self, reduction: Reduction, a: Place) -> Lanes<L> {
        let (values, total) = (self.get(a), self.result[0][0]);
        let tangents = (0..a.length).map(|i| self.tangent(a, i));
        match reduction {
            Reduction::Sum => sum(tangents),
            Reduction::Min | Reduction::Max => {
                let chosen = values.iter().position(|x| x[0] == total);
                chosen.map_or([0.0; L], |i| self.tangent(a, i))
            }
            Reduction::LogSumExp => {
                let share = |x: f64| if x == total { 1.0 } else { (x - total).exp() };
                sum(tangents.zip(values).map(|(t, x)| times(share(x[0]), t)))
            }
        }
    }
}

fn times<const L: usize>(factor: f64, lanes: Lanes<L>) -> Lanes<L> {
    lanes.map(|x| factor * x)
}

fn sum<const L: usize>(each: impl Iterator<Item = Lanes<L>>) -> Lanes<L> {
    each.fold([0.0; L], |sum, lanes| std::array::from_fn(|l| sum[l] + lanes[l]))
}

//! Evaluation of the values of a program.

use super::function::Reduction;
use super::operator::{Lanes, select};
use super::program::{Action, Place, Program, Tables};
use crate::math::special::ln_sum_exp;

/// Computes all registers behind those of the unknowns.
pub(super) fn run<const L: usize>(
    program: &Program,
    constants: &[Lanes<L>],
    registers: &mut [Lanes<L>],
) {
    for instruction in &program.instructions {
        let (done, rest) = registers.split_at_mut(instruction.start);
        let out = &mut rest[..instruction.length];
        step(&instruction.action, &program.tables, constants, done, out);
    }
}

/// Computes the result of one action.
pub(super) fn step<const L: usize>(
    action: &Action,
    tables: &Tables,
    constants: &[Lanes<L>],
    registers: &[Lanes<L>],
    out: &mut [Lanes<L>],
) {
    let get = |place: Place| {
        let from = if place.constant { constants } else { registers };
        &from[place.range()]
    };
    match action {
        Action::Unary(operation, a) => operation.values(get(*a), out),
        Action::Binary(operation, a, b) => operation.values(get(*a), get(*b), out),
        Action::Select(condition, yes, no) => {
            let (condition, yes, no) = (get(*condition), get(*yes), get(*no));
            for (i, out) in out.iter_mut().enumerate() {
                let (c, y, n) = (element(condition, i), element(yes, i), element(no, i));
                for l in 0..L {
                    out[l] = select(c[l], y[l], n[l]);
                }
            }
        }
        Action::Reduce(reduction, a) => out[0] = reduce(*reduction, get(*a)),
        Action::Gather(a, indices) => {
            let a = get(*a);
            out.iter_mut().zip(&tables.indices[*indices]).for_each(|(out, &i)| *out = a[i]);
        }
        Action::Join(parts) => {
            let elements = parts.iter().flat_map(|part| get(*part));
            out.iter_mut().zip(elements).for_each(|(out, element)| *out = *element);
        }
        Action::MatrixProduct(matrix, a) => {
            let a = get(*a);
            for (out, row) in out.iter_mut().zip(tables.matrices[*matrix].iter_rows()) {
                *out = [0.0; L];
                for (x, a) in row.iter().zip(a) {
                    for l in 0..L {
                        out[l] += x * a[l];
                    }
                }
            }
        }
        Action::Recurrence(start, factor, input) => {
            let (factor, input) = (get(*factor), get(*input));
            let mut last = get(*start)[0];
            for (i, out) in out.iter_mut().enumerate() {
                let (f, u) = (element(factor, i), &input[i]);
                for l in 0..L {
                    last[l] = f[l] * last[l] + u[l];
                }
                *out = last;
            }
        }
        Action::Interpolate(curve, a) => {
            let curve = &tables.curves[*curve];
            for (out, a) in out.iter_mut().zip(get(*a)) {
                for l in 0..L {
                    out[l] = curve.height(a[l]);
                }
            }
        }
    }
}

/// Element `i` of a value; a value with one element has it at every index.
fn element<T>(values: &[T], i: usize) -> &T {
    &values[if values.len() == 1 { 0 } else { i }]
}

fn reduce<const L: usize>(reduction: Reduction, a: &[Lanes<L>]) -> Lanes<L> {
    match reduction {
        Reduction::Sum => sum(a),
        Reduction::Min => fold(a, |x, y| if x <= y || x.is_nan() { x } else { y }),
        Reduction::Max => fold(a, |x, y| if x >= y || x.is_nan() { x } else { y }),
        Reduction::LogSumExp => fold(a, ln_sum_exp),
    }
}

fn fold<const L: usize>(a: &[Lanes<L>], f: impl Fn(f64, f64) -> f64) -> Lanes<L> {
    let mut result = a[0];
    for element in &a[1..] {
        for l in 0..L {
            result[l] = f(result[l], element[l]);
        }
    }
    result
}

/// The sum as four interleaved partial sums, in the same order for any number of lanes.
fn sum<const L: usize>(a: &[Lanes<L>]) -> Lanes<L> {
    let mut partial = [[0.0; L]; 4];
    for four in a.chunks(4) {
        for (partial, element) in partial.iter_mut().zip(four) {
            for l in 0..L {
                partial[l] += element[l];
            }
        }
    }
    let [a, b, c, d] = partial;
    std::array::from_fn(|l| (a[l] + b[l]) + (c[l] + d[l]))
}

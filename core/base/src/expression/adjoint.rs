//! Derivatives of the outputs of a tape by some of its unknowns, from each output back to them.
//!
//! A. Griewank and A. Walther, Evaluating Derivatives, 2nd edition, SIAM 2008, chapter 3. For few outputs this takes fewer
//! operations than one pass per direction. As in [`reverse`](super::reverse), a zero adjoint contributes nothing and a zero
//! slope receives nothing, whatever the other factor.

use super::tape::{Scalar, Step};

/// The backward passes of all outputs.
#[derive(Debug)]
pub(super) struct Adjoint {
    rows: Vec<Row>,
    /// Number of constants and unknowns: the number of the first step's value.
    first: usize,
    /// Adjoint of each constant, unknown and step.
    adjoints: Vec<f64>,
}

/// The backward pass of one output.
#[derive(Debug)]
struct Row {
    output: usize,
    /// The steps between the unknowns and the output, the last first.
    steps: Vec<usize>,
    /// Numbers of the unknowns that are wanted and on which the output depends, in ascending order.
    unknowns: Vec<usize>,
}

impl Adjoint {
    /// The passes for a tape whose unknowns have the numbers from `place.0` to below `place.1`, where the steps follow.
    pub fn new(steps: &[Step], place: (usize, usize), outputs: &[usize], wanted: &[bool]) -> Self {
        let (unknowns, first) = place;
        let mut leads = vec![false; first + steps.len()];
        leads[unknowns..first].copy_from_slice(wanted);
        for (i, step) in steps.iter().enumerate() {
            leads[first + i] = step.arguments.iter().any(|&a| leads[a]);
        }
        let row = |&output: &usize| {
            let mut uses = vec![false; leads.len()];
            uses[output] = leads[output];
            let mut own = Vec::new();
            for (i, step) in steps.iter().enumerate().rev() {
                if uses[first + i] {
                    step.arguments.iter().for_each(|&a| uses[a] |= leads[a]);
                    own.push(i);
                }
            }
            let unknowns = (unknowns..first).filter(|&i| uses[i]).collect();
            Row { output, steps: own, unknowns }
        };
        let rows = outputs.iter().map(row).collect();
        Self { rows, first, adjoints: vec![0.0; leads.len()] }
    }

    /// For each output the numbers of the unknowns by which it is differentiated.
    pub fn pattern(&self) -> impl Iterator<Item = &[usize]> {
        self.rows.iter().map(|row| &row.unknowns[..])
    }

    /// Number of steps of all passes.
    pub fn cost(&self) -> usize {
        self.rows.iter().map(|row| row.steps.len()).sum()
    }

    /// Writes the derivatives, output by output in the order of the pattern. `partials` holds those of each step by its first
    /// two arguments.
    pub fn run(&mut self, steps: &[Step], partials: &[[f64; 2]], out: &mut [f64]) {
        let (adjoints, first) = (&mut self.adjoints[..], self.first);
        let mut out = out.iter_mut();
        for row in &self.rows {
            row.unknowns.iter().for_each(|&i| adjoints[i] = 0.0);
            row.steps.iter().for_each(|&i| adjoints[first + i] = 0.0);
            adjoints[row.output] = 1.0;
            for &i in &row.steps {
                let weight = adjoints[first + i];
                if weight == 0.0 {
                    continue;
                }
                let (step, [left, right]) = (&steps[i], partials[i]);
                let [a, b, c] = step.arguments;
                match step.action {
                    Scalar::Unary(_) | Scalar::Interpolate(..) => {
                        adjoints[a] += share(weight, left);
                    }
                    Scalar::Binary(_) => {
                        adjoints[a] += share(weight, left);
                        adjoints[b] += share(weight, right);
                    }
                    Scalar::Select => adjoints[if left == 0.0 { c } else { b }] += weight,
                }
            }
            row.unknowns.iter().zip(out.by_ref()).for_each(|(&i, out)| *out = adjoints[i]);
        }
    }
}

fn share(weight: f64, slope: f64) -> f64 {
    if slope == 0.0 { 0.0 } else { weight * slope }
}

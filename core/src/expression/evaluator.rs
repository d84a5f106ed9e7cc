//! One program at many points, one after the other, without allocation.

use super::operator::Lanes;
use super::program::Program;
use super::{forward, tangent};

/// Evaluates a program again and again; what has been computed at a point serves its values and derivatives.
///
/// ```
/// use lacuna::expression::{Evaluator, Scope};
///
/// let mut scope = Scope::new();
/// scope.unknown("x")?;
/// scope.unknown("k")?;
/// scope.define("rate", "-k * x^2")?;
/// let program = scope.compile(&["rate"]).expect("no fault");
/// let mut evaluator = Evaluator::new(&program);
/// let mut out = [0.0];
/// evaluator.at(&[3.0, 2.0]);
/// evaluator.values(&mut out);
/// assert_eq!(out, [-18.0]);
/// evaluator.slopes(&[1.0, 0.0], &mut out);
/// assert_eq!(out, [-12.0]);
/// # Ok::<(), lacuna::expression::Fault>(())
/// ```
#[derive(Debug)]
pub struct Evaluator<'p> {
    program: &'p Program,
    registers: Vec<Lanes<1>>,
    tangents: Vec<f64>,
    /// Whether the registers hold the values at their first entries.
    filled: bool,
}

impl<'p> Evaluator<'p> {
    /// No point yet.
    pub fn new(program: &'p Program) -> Self {
        Self {
            program,
            registers: vec![[0.0]; program.registers],
            tangents: vec![0.0; program.registers],
            filled: false,
        }
    }

    /// Goes to a point; costs nothing where it is already.
    ///
    /// # Panics
    ///
    /// When the point has not [`Program::unknowns`] coordinates.
    pub fn at(&mut self, point: &[f64]) {
        assert_eq!(point.len(), self.program.unknowns, "the coordinates of a point");
        let same = |(lane, x): (&Lanes<1>, &f64)| lane[0].to_bits() == x.to_bits();
        if self.filled && self.registers.iter().zip(point).all(same) {
            return;
        }
        self.registers.iter_mut().zip(point).for_each(|(lane, x)| lane[0] = *x);
        forward::run(self.program, &self.program.constants, &mut self.registers);
        self.filled = true;
    }

    /// The values at the point, the outputs one after the other.
    pub fn values(&self, out: &mut [f64]) {
        let mut out = out.iter_mut();
        for place in &self.program.outputs {
            let from = if place.constant { &self.program.constants } else { &self.registers };
            from[place.range()].iter().zip(out.by_ref()).for_each(|(lane, out)| *out = lane[0]);
        }
    }

    /// The derivatives of the values along a direction.
    pub fn slopes(&mut self, direction: &[f64], out: &mut [f64]) {
        self.tangents.fill(0.0);
        self.tangents[..self.program.unknowns].copy_from_slice(direction);
        tangent::run(self.program, &self.registers, &mut self.tangents);
        let mut out = out.iter_mut();
        for place in &self.program.outputs {
            for (i, out) in place.range().zip(out.by_ref()) {
                *out = if place.constant { 0.0 } else { self.tangents[i] };
            }
        }
    }
}

//! Evaluation of one program at many points in turn, without allocation.

use super::operator::Lanes;
use super::program::Program;
use super::{forward, tangent};

/// Number of directions that [`Evaluator::slopes_together`] takes.
pub const DIRECTIONS: usize = 4;

/// Evaluates a program repeatedly; intermediate results at a point are shared by its values and derivatives.
///
/// ```
/// # use lacuna_base as lacuna;
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
    tangents: Vec<Lanes<1>>,
    wide: Vec<Lanes<DIRECTIONS>>,
    /// True if the registers hold the values at the first entries of the point.
    filled: bool,
}

impl<'p> Evaluator<'p> {
    /// An evaluator that is at no point yet.
    pub fn new(program: &'p Program) -> Self {
        Self {
            program,
            registers: vec![[0.0]; program.registers],
            tangents: vec![[0.0]; program.registers],
            wide: vec![[0.0; DIRECTIONS]; program.registers],
            filled: false,
        }
    }

    /// Sets the point; free of cost if it is the present one.
    ///
    /// # Panics
    ///
    /// If the point does not have [`Program::unknowns`] coordinates.
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

    /// Writes the values at the point, the outputs concatenated.
    pub fn values(&self, out: &mut [f64]) {
        let mut out = out.iter_mut();
        for place in &self.program.outputs {
            let from = if place.constant { &self.program.constants } else { &self.registers };
            from[place.range()].iter().zip(out.by_ref()).for_each(|(lane, out)| *out = lane[0]);
        }
    }

    /// Writes the derivatives of the values along a direction.
    pub fn slopes(&mut self, direction: &[f64], out: &mut [f64]) {
        self.tangents.fill([0.0]);
        self.tangents.iter_mut().zip(direction).for_each(|(tangent, x)| *tangent = [*x]);
        tangent::run(self.program, &self.registers, &mut self.tangents);
        self.slopes_of(&self.tangents, out.iter_mut(), |out, tangent| *out = tangent[0]);
    }

    /// Writes the derivatives of the values along several directions at once: `directions` holds the component of each
    /// unknown along each direction, the result the slope of each value along each direction.
    pub fn slopes_together(
        &mut self,
        directions: &[[f64; DIRECTIONS]],
        out: &mut [[f64; DIRECTIONS]],
    ) {
        self.wide.fill([0.0; DIRECTIONS]);
        self.wide[..self.program.unknowns].copy_from_slice(directions);
        tangent::run(self.program, &self.registers, &mut self.wide);
        self.slopes_of(&self.wide, out.iter_mut(), |out, tangent| *out = tangent);
    }

    fn slopes_of<const L: usize, T>(
        &self,
        tangents: &[Lanes<L>],
        mut out: impl Iterator<Item = T>,
        put: impl Fn(T, Lanes<L>),
    ) {
        for place in &self.program.outputs {
            for (i, out) in place.range().zip(out.by_ref()) {
                put(out, if place.constant { [0.0; L] } else { tangents[i] });
            }
        }
    }
}

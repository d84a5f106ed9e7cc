//! Evaluation of one program at many points in turn, without allocation.

use super::adjoint::Adjoint;
use super::operator::Lanes;
use super::program::Program;
use super::tape::Tape;
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
    /// The steps of a program without vectors.
    tape: Option<Tape>,
    registers: Vec<Lanes<1>>,
    tangents: Vec<Lanes<1>>,
    wide: Vec<Lanes<DIRECTIONS>>,
    /// The backward passes of [`Evaluator::derivatives`].
    adjoint: Option<Adjoint>,
    /// True if there has been a point.
    filled: bool,
}

impl<'p> Evaluator<'p> {
    /// An evaluator that is at no point yet.
    pub fn new(program: &'p Program) -> Self {
        let tape = Tape::of(program);
        let (registers, tangents) = match &tape {
            Some(tape) => (0, tape.length()),
            None => (program.registers, program.registers),
        };
        Self {
            program,
            tape,
            registers: vec![[0.0]; registers],
            tangents: vec![[0.0]; tangents],
            wide: vec![[0.0; DIRECTIONS]; tangents],
            adjoint: None,
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
        let first = !std::mem::replace(&mut self.filled, true);
        if let Some(tape) = &mut self.tape {
            tape.at(self.program, point, first);
            return;
        }
        let same = |(lane, x): (&Lanes<1>, &f64)| lane[0].to_bits() == x.to_bits();
        if first || !self.registers.iter().zip(point).all(same) {
            self.registers.iter_mut().zip(point).for_each(|(lane, x)| lane[0] = *x);
            forward::run(self.program, &self.program.constants, &mut self.registers);
        }
    }

    /// Writes the values at the point, the outputs concatenated.
    pub fn values(&self, out: &mut [f64]) {
        if let Some(tape) = &self.tape {
            return tape.values(out);
        }
        let mut out = out.iter_mut();
        for place in &self.program.outputs {
            let from = if place.constant { &self.program.constants } else { &self.registers };
            from[place.range()].iter().zip(out.by_ref()).for_each(|(lane, out)| *out = lane[0]);
        }
    }

    /// Writes the derivatives of the values along a direction.
    pub fn slopes(&mut self, direction: &[f64], out: &mut [f64]) {
        let Self { program, tape, registers, tangents, .. } = self;
        let lanes = direction.iter().map(|x| [*x]);
        let out = out.iter_mut();
        along(program, tape, registers, tangents, lanes, out, |out, [slope]| *out = slope);
    }

    /// Writes the derivatives of the values along several directions at once: `directions` holds the component of each
    /// unknown along each direction, the result the slope of each value along each direction.
    pub fn slopes_together(
        &mut self,
        directions: &[[f64; DIRECTIONS]],
        out: &mut [[f64; DIRECTIONS]],
    ) {
        let Self { program, tape, registers, wide, .. } = self;
        let (lanes, out) = (directions.iter().copied(), out.iter_mut());
        along(program, tape, registers, wide, lanes, out, |out, slopes| *out = slopes);
    }

    /// Prepares [`Evaluator::derivatives`] by the unknowns that are wanted, and returns for each value the unknowns among
    /// them on which it depends. `None` if the slopes along one direction for each of the `directions` of interest take
    /// fewer operations, or if the program has vectors.
    pub fn prepare(&mut self, wanted: &[bool], directions: usize) -> Option<Vec<Vec<usize>>> {
        let tape = self.tape.as_ref()?;
        let adjoint = tape.adjoint(wanted);
        // One pass along several directions takes about twice as long as one along a single direction.
        if adjoint.cost() > 2 * tape.steps() * directions.div_ceil(DIRECTIONS) {
            return None;
        }
        let constants = tape.constants();
        let of_row = |row: &[usize]| row.iter().map(|i| i - constants).collect();
        let pattern = adjoint.pattern().map(of_row).collect();
        self.adjoint = Some(adjoint);
        Some(pattern)
    }

    /// Writes the derivatives of the values at the point by the unknowns that [`Evaluator::prepare`] returned for them, value
    /// by value; nothing if it returned none.
    pub fn derivatives(&mut self, out: &mut [f64]) {
        if let (Some(tape), Some(adjoint)) = (&mut self.tape, &mut self.adjoint) {
            tape.pull(adjoint, out);
        }
    }
}

/// Computes the slopes of all values along directions, whose components by each unknown are `lanes`, and puts those of
/// the outputs into `out`.
fn along<const L: usize, T>(
    program: &Program,
    tape: &mut Option<Tape>,
    registers: &[Lanes<1>],
    tangents: &mut [Lanes<L>],
    lanes: impl Iterator<Item = Lanes<L>>,
    mut out: impl Iterator<Item = T>,
    put: impl Fn(T, Lanes<L>),
) {
    if let Some(tape) = tape {
        let first = tape.constants();
        tangents[first..].iter_mut().zip(lanes).for_each(|(tangent, lane)| *tangent = lane);
        tape.push(tangents);
        tape.outputs().iter().zip(out).for_each(|(&i, out)| put(out, tangents[i]));
        return;
    }
    tangents.fill([0.0; L]);
    tangents.iter_mut().zip(lanes).for_each(|(tangent, lane)| *tangent = lane);
    tangent::run(program, registers, tangents);
    for place in &program.outputs {
        for (i, out) in place.range().zip(out.by_ref()) {
            put(out, if place.constant { [0.0; L] } else { tangents[i] });
        }
    }
}

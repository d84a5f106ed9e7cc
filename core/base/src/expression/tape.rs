//! Programs of single numbers as a flat list of steps.
//!
//! Most programs have no vectors. Their steps need no ranges of registers, and the derivatives of each step by its
//! arguments are computed once for a point and shared by all directions. A step is done again only if an unknown on
//! which it depends has changed. Values and derivatives are those of [`forward`](super::forward) and
//! [`tangent`](super::tangent), bit by bit.

use super::adjoint::Adjoint;
use super::curve::Segment;
use super::operator::{Binary, Lanes, Unary, select};
use super::program::{Action, Place, Program};

/// A program without vectors, and its state at a point.
#[derive(Debug)]
pub(super) struct Tape {
    steps: Vec<Step>,
    /// Number of constants, whose numbers come before those of the unknowns.
    constants: usize,
    unknowns: usize,
    /// Constants, unknowns, and the value of each step.
    values: Vec<f64>,
    /// Derivatives of each step by its first and second argument.
    partials: Vec<[f64; 2]>,
    /// Unknowns that have changed since the derivatives were computed.
    stale: u64,
    outputs: Vec<usize>,
    /// The segment that each interpolation used last.
    segments: Vec<Segment>,
}

/// One operation of a tape.
#[derive(Debug)]
pub(super) struct Step {
    pub action: Scalar,
    /// Numbers of the arguments; of one with fewer than three, the last are repeated.
    pub arguments: [usize; 3],
    /// The unknowns on which the step depends.
    depends: u64,
}

/// Action of a step.
#[derive(Debug)]
pub(super) enum Scalar {
    Unary(Unary),
    Binary(Binary),
    Select,
    /// The curve, and the place of its segment.
    Interpolate(usize, usize),
}

/// Bit of an unknown; those from the 64th on share the last.
fn bit(unknown: usize) -> u64 {
    1 << unknown.min(63)
}

impl Tape {
    /// The steps of a program; `None` if it has vectors.
    pub fn of(program: &Program) -> Option<Self> {
        let constants = program.constants.len();
        let number = |place: &Place| match (place.length, place.constant) {
            (1, true) => Some(place.start),
            (1, false) => Some(constants + place.start),
            _ => None,
        };
        let mut depends = vec![0; constants];
        depends.extend((0..program.unknowns).map(bit));
        let mut steps = Vec::with_capacity(program.instructions.len());
        let mut segments = Vec::new();
        for instruction in &program.instructions {
            if (instruction.start, instruction.length) != (program.unknowns + steps.len(), 1) {
                return None;
            }
            let action = match &instruction.action {
                Action::Unary(operation, _) => Scalar::Unary(*operation),
                Action::Binary(operation, ..) => Scalar::Binary(*operation),
                Action::Select(..) => Scalar::Select,
                Action::Interpolate(curve, _) => {
                    segments.push(Segment::NONE);
                    Scalar::Interpolate(*curve, segments.len() - 1)
                }
                _ => return None,
            };
            let places = instruction.action.places();
            let given: Vec<usize> = places.iter().map(number).collect::<Option<_>>()?;
            let arguments = std::array::from_fn(|i| given[i.min(given.len() - 1)]);
            let of_step = given.iter().map(|&i| depends[i]).fold(0, |all, own| all | own);
            depends.push(of_step);
            steps.push(Step { action, arguments, depends: of_step });
        }
        let mut values: Vec<f64> = program.constants.iter().map(|lane| lane[0]).collect();
        values.resize(depends.len(), 0.0);
        Some(Self {
            partials: vec![[0.0; 2]; steps.len()],
            steps,
            constants,
            unknowns: program.unknowns,
            values,
            stale: u64::MAX,
            outputs: program.outputs.iter().map(number).collect::<Option<_>>()?,
            segments,
        })
    }

    /// Sets the point; of the first one `all` is true, later only what depends on a changed unknown is computed.
    pub fn at(&mut self, program: &Program, point: &[f64], all: bool) {
        let mut changed = if all { u64::MAX } else { 0 };
        let unknowns = self.values[self.constants..].iter_mut().zip(point);
        for (i, (now, x)) in unknowns.enumerate() {
            if now.to_bits() != x.to_bits() {
                *now = *x;
                changed |= bit(i);
            }
        }
        self.stale |= changed;
        let first = self.constants + self.unknowns;
        for (i, step) in self.steps.iter().enumerate() {
            if all || step.depends & changed != 0 {
                let [a, b, c] = step.arguments.map(|i| self.values[i]);
                self.values[first + i] = match step.action {
                    Scalar::Unary(operation) => operation.value(a),
                    Scalar::Binary(operation) => operation.value(a, b),
                    Scalar::Select => select(a, b, c),
                    Scalar::Interpolate(curve, place) => {
                        let segment = &mut self.segments[place];
                        if !segment.contains(a) {
                            *segment = program.tables.curves[curve].segment(a);
                        }
                        segment.height(a)
                    }
                };
            }
        }
    }

    /// Writes the values of the outputs.
    pub fn values(&self, out: &mut [f64]) {
        self.outputs.iter().zip(out).for_each(|(&i, out)| *out = self.values[i]);
    }

    /// Computes the derivatives of all steps by their arguments at the point.
    fn differentiate(&mut self) {
        if self.stale == 0 {
            return;
        }
        let first = self.constants + self.unknowns;
        for (i, (step, partials)) in self.steps.iter().zip(&mut self.partials).enumerate() {
            if step.depends & self.stale == 0 {
                continue;
            }
            let [a, b, _] = step.arguments.map(|i| self.values[i]);
            let value = self.values[first + i];
            *partials = match step.action {
                Scalar::Unary(operation) => [operation.slope_at(a, value), 0.0],
                Scalar::Binary(operation) => operation.slopes_at(a, b, value),
                // The argument that was chosen.
                Scalar::Select => [f64::from(u8::from(a != 0.0)), 0.0],
                Scalar::Interpolate(_, place) => [self.segments[place].slope(a), 0.0],
            };
        }
        self.stale = 0;
    }

    /// Computes the slopes of all steps along `L` directions, whose components by the unknowns stand in `tangents`
    /// behind a zero for each constant.
    pub fn push<const L: usize>(&mut self, tangents: &mut [Lanes<L>]) {
        self.differentiate();
        let first = self.constants + self.unknowns;
        for (i, (step, &[left, right])) in self.steps.iter().zip(&self.partials).enumerate() {
            let (before, rest) = tangents.split_at_mut(first + i);
            let [a, b, c] = step.arguments;
            rest[0] = match step.action {
                Scalar::Unary(_) => times(&before[a], left),
                Scalar::Binary(_) => {
                    let (left, right) = (times(&before[a], left), times(&before[b], right));
                    std::array::from_fn(|l| left[l] + right[l])
                }
                Scalar::Select => before[if left == 0.0 { c } else { b }],
                Scalar::Interpolate(..) if before[a] == [0.0; L] => [0.0; L],
                Scalar::Interpolate(..) => before[a].map(|t| left * t),
            };
        }
    }

    /// The backward pass to these unknowns (true for those that are wanted).
    pub fn adjoint(&self, wanted: &[bool]) -> Adjoint {
        let first = self.constants + self.unknowns;
        Adjoint::new(&self.steps, (self.constants, first), &self.outputs, wanted)
    }

    /// Writes the derivatives of the outputs at the point that a backward pass gives.
    pub fn pull(&mut self, adjoint: &mut Adjoint, out: &mut [f64]) {
        self.differentiate();
        adjoint.run(&self.steps, &self.partials, out);
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// Number of constants: that of the first unknown.
    pub fn constants(&self) -> usize {
        self.constants
    }

    /// Number of values: constants, unknowns and steps.
    pub fn length(&self) -> usize {
        self.values.len()
    }

    /// Numbers of the outputs.
    pub fn outputs(&self) -> &[usize] {
        &self.outputs
    }
}

/// A slope times a tangent. A zero tangent contributes nothing, even if the slope is infinite or undefined, and a zero
/// slope nothing, whatever the tangent.
fn times<const L: usize>(tangent: &Lanes<L>, slope: f64) -> Lanes<L> {
    if slope == 0.0 {
        return [0.0; L];
    }
    tangent.map(|t| if t == 0.0 { 0.0 } else { t * slope })
}

//! Breakpoints of a program: boundaries of conditions and nodes of tables, where its values have a kink or a jump.

use super::operator::{Binary, Unary};
use super::program::{Action, Instruction, Place, Program};

/// A quantity of a program at certain values of which the program's result has a kink or a jump.
///
/// Integrators stop at these values: between them the program is smooth.
#[derive(Clone, Debug)]
pub struct Break {
    /// The quantity, as a program in the same unknowns.
    pub quantity: Program,
    /// Values of the quantity at which the result breaks, ascending.
    pub at: Vec<f64>,
    /// True if the result may jump there; otherwise only its slope does.
    pub jumps: bool,
}

impl Program {
    /// The breakpoints: comparisons (where both sides are equal), `sign`, `abs`, `min` and `max` of two numbers, and
    /// the nodes of tables: those of a spline are the ends only. Breakpoints of vectors, and of `floor` and `ceil`, are not included.
    pub fn breaks(&self) -> Vec<Break> {
        self.instructions.iter().filter_map(|instruction| self.break_of(instruction)).collect()
    }

    fn break_of(&self, instruction: &Instruction) -> Option<Break> {
        if instruction.length != 1 {
            return None;
        }
        let found = |quantity: Program, at: Vec<f64>, jumps: bool| Break { quantity, at, jumps };
        match &instruction.action {
            Action::Unary(Unary::Sign, a) => Some(found(self.giving(*a), vec![0.0], true)),
            Action::Unary(Unary::Abs, a) => Some(found(self.giving(*a), vec![0.0], false)),
            Action::Binary(operation, a, b) => {
                let jumps = operation.compares();
                let breaks = jumps || matches!(operation, Binary::Min | Binary::Max);
                breaks.then(|| found(self.difference(*a, *b), vec![0.0], jumps))
            }
            Action::Interpolate(curve, a) => {
                let (nodes, jumps) = self.tables.curves[*curve].breaks();
                Some(found(self.giving(*a), nodes, jumps))
            }
            _ => None,
        }
    }

    /// A program whose output is the value at `place`.
    fn giving(&self, place: Place) -> Self {
        Self { outputs: vec![place], ..self.clone() }.pruned()
    }

    fn difference(&self, a: Place, b: Place) -> Self {
        let place = Place { constant: false, start: self.registers, length: 1 };
        let action = Action::Binary(Binary::Subtract, a, b);
        let mut program = self.clone();
        program.instructions.push(Instruction { action, start: place.start, length: 1 });
        program.registers += 1;
        program.outputs = vec![place];
        program.pruned()
    }

    /// Removes instructions that no output depends on.
    pub(super) fn pruned(mut self) -> Self {
        let mut needed = vec![false; self.registers];
        let mark = |needed: &mut Vec<bool>, place: &Place| {
            if !place.constant {
                needed[place.range()].fill(true);
            }
        };
        self.outputs.iter().for_each(|place| mark(&mut needed, place));
        let mut instructions = Vec::new();
        for instruction in self.instructions.into_iter().rev() {
            let results = instruction.start..instruction.start + instruction.length;
            if needed[results].contains(&true) {
                instruction.action.places().iter().for_each(|place| mark(&mut needed, place));
                instructions.push(instruction);
            }
        }
        instructions.reverse();
        self.instructions = instructions;
        self
    }
}

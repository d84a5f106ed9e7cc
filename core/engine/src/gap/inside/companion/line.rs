//! Inputs that are the same physics at several places: one candidate whose place is an unknown.
//!
//! Between two places the change is interpolated linearly: part of the size acts at the one, the rest at the other.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;

use super::learned::LearnedChange;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::change::Change;
use crate::gap::inside::pieces::Piece;

/// Inputs along a line, as one candidate.
pub(super) struct Line {
    pub kind: String,
    pub description: Description,
    /// The size, then the place.
    pub inputs: Vec<FreeInput>,
    pub places: Places,
}

/// Learned changes at places in increasing order.
#[derive(Debug, Clone, Default)]
pub(super) struct Places {
    at: Vec<f64>,
    changes: Vec<LearnedChange>,
}

impl Line {
    /// Adds the change of an input at a place to the line of its type.
    pub fn add(
        lines: &mut Vec<Self>,
        kind: String,
        at: f64,
        piece: &Piece,
        inputs: Vec<FreeInput>,
        change: LearnedChange,
    ) {
        let known = lines.iter().position(|line| line.kind == kind);
        let k = known.unwrap_or_else(|| {
            let (description, places) = (piece.description.clone(), Places::default());
            lines.push(Self { kind, description, inputs, places });
            lines.len() - 1
        });
        lines[k].places.at.push(at);
        lines[k].places.changes.push(change);
    }

    /// The line with its places in increasing order and with their inputs; one place is none.
    pub fn sorted(mut self) -> Self {
        let Places { at, changes } = self.places;
        let mut pairs: Vec<(f64, LearnedChange)> = at.into_iter().zip(changes).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (at, changes): (Vec<f64>, Vec<LearnedChange>) = pairs.into_iter().unzip();
        self.inputs[0].name.clone_from(&self.kind);
        if let [first, .., last] = at[..] {
            let law = Distribution::Uniform([first, last]);
            let name = format!("{}_place", self.kind);
            let place = FreeInput::new(&name, Unit::dimensionless(), at[at.len() / 2], law);
            self.inputs.push(place.starting_from(at.clone()));
            self.description.formula =
                format!("the companion's change at a place between {first} and {last}");
        }
        self.places = Places { at, changes };
        self
    }
}

impl Change for Places {
    /// The change of a size at a place: `values` are both, or the size alone if there is one place.
    fn at(&self, point: &[f64], values: &[f64]) -> Vec<f64> {
        let size = &values[..1];
        let Some(&place) = values.get(1) else { return self.changes[0].at(point, size) };
        let last = self.at.len() - 1;
        let above = self.at.partition_point(|x| *x < place).clamp(1, last);
        let (low, high) = (self.at[above - 1], self.at[above]);
        let share = ((place - low) / (high - low)).clamp(0.0, 1.0);
        let [below, above] = [above - 1, above].map(|k| self.changes[k].at(point, size));
        below.iter().zip(above).map(|(a, b)| (1.0 - share) * a + share * b).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use lacuna::data::Parameter;
    use lacuna::math::random::Stream;

    use super::super::learned::{Basis, Region};
    use super::*;

    /// The learned change of an input whose change is `factor` times the size on three outputs.
    fn learned(factor: f64, input: &FreeInput) -> LearnedChange {
        let parameters = [Parameter::plain("a", Distribution::Uniform([0.0, 10.0]))];
        let region = Region::around(&parameters, &[5.0]);
        let basis = Basis::new(region, std::slice::from_ref(input), 1.0);
        let points = basis.points(&Stream::root(1));
        let differences: Vec<Vec<f64>> =
            points.iter().map(|(_, values)| vec![factor * values[0]; 3]).collect();
        LearnedChange::of(basis, &points, &differences).unwrap()
    }

    /// The line through inputs at 3, 1 and 2, whose changes are 30, 10 and 40 times their size.
    fn line() -> Line {
        let mut lines = Vec::new();
        for (at, factor) in [(3.0, 30.0), (1.0, 10.0), (2.0, 40.0)] {
            let law = Distribution::HalfNormal(0.5);
            let input = FreeInput::new(&format!("leak_{at}"), Unit::dimensionless(), 0.0, law);
            let description = Description {
                title: "a leak".into(),
                formula: String::new(),
                source: String::new(),
            };
            let (places, addition) = (vec![0], None);
            let piece =
                Piece { kind: "leak".into(), description, places, addition, at: None, tried: 1 };
            let change = learned(factor, &input);
            Line::add(&mut lines, "leak".into(), at, &piece, vec![input], change);
        }
        assert_eq!(lines.len(), 1);
        lines.remove(0).sorted()
    }

    /// At a place of an input the change is that of the input; between two places it is interpolated.
    #[test]
    fn a_change_moves_along_its_line() {
        let line = line();
        for (place, factor) in [(1.0, 10.0), (1.5, 25.0), (2.0, 40.0), (2.25, 37.5), (3.0, 30.0)] {
            let change = line.places.at(&[5.2], &[0.4, place]);
            // The ridge of the regression is a millionth.
            assert!(change.iter().all(|y| (y - 0.4 * factor).abs() < 1e-4), "{place} {change:?}");
        }
    }

    /// The unknowns are the size, with the name of the physics, and its place, which starts at every input.
    #[test]
    fn the_place_is_an_unknown() {
        let Line { inputs, .. } = line();
        let names: Vec<&str> = inputs.iter().map(|input| input.name.as_str()).collect();
        assert_eq!(names, ["leak", "leak_place"]);
        assert_eq!(inputs[1].prior, Distribution::Uniform([1.0, 3.0]));
        assert_eq!(inputs[1].starts, [1.0, 2.0, 3.0]);
    }
}

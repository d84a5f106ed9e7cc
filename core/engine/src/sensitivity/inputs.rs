//! Random inputs, and draws of some of them given the others.

use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;

/// A joint distribution of inputs.
pub trait Inputs: Sync {
    /// Number of inputs.
    fn dimension(&self) -> usize;

    /// Returns true if all inputs are independent.
    fn independent(&self) -> bool;

    /// One draw.
    fn draw(&self, stream: &Stream) -> Vec<f64>;

    /// The point with the inputs `free` drawn anew, from their distribution given the others. Independent inputs that are
    /// drawn anew with the same stream have the same values, whichever others are.
    fn redraw(&self, point: &[f64], free: &[bool], stream: &Stream) -> Vec<f64>;
}

/// Independent inputs with these distributions.
#[derive(Debug, Clone, PartialEq)]
pub struct Independent(pub Vec<Distribution>);

impl Inputs for Independent {
    fn dimension(&self) -> usize {
        self.0.len()
    }

    fn independent(&self) -> bool {
        true
    }

    fn draw(&self, stream: &Stream) -> Vec<f64> {
        let mut generator = stream.generator();
        self.0.iter().map(|law| law.sample(&mut generator)).collect()
    }

    fn redraw(&self, point: &[f64], free: &[bool], stream: &Stream) -> Vec<f64> {
        let other = self.draw(stream);
        let each = point.iter().zip(other).zip(free);
        each.map(|((&kept, drawn), &free)| if free { drawn } else { kept }).collect()
    }
}

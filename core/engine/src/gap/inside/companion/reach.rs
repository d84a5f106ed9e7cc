//! The reach of a candidate: the largest distance of its size from absence for which its change is learned.

use lacuna::run::Stop;
use lacuna_linalg::vector::dot;

use super::effect::{Extent, Learning};
use super::learned::distances;
use crate::gap::experiment::wider::FreeInput;
use crate::stage::direct::ModelMap;

/// Changes are learned up to this multiple of the misfit, or of the size that was found.
const FAR: f64 = 3.0;

/// The smallest part of a tangent that is not along the others.
const NEW: f64 = 1e-6;

/// The companion without any candidate at the middle of the region, and how its response moves with the study's parameters.
pub(super) struct Reach<'a, 'b> {
    learning: &'b Learning<'a>,
    without: Vec<f64>,
    /// Orthonormal rows.
    tangents: Vec<Vec<f64>>,
}

impl<'a, 'b> Reach<'a, 'b> {
    /// Evaluates the companion `bare` at the middle of the region and on both sides of it along each parameter.
    pub fn new(learning: &'b Learning<'a>, bare: &ModelMap<'_>) -> Result<Self, Stop> {
        let points = learning.region.cross();
        let answers = learning.answers(bare, points.iter().map(|point| (point, &[][..])))?;
        let without = answers.row(0).to_vec();
        let mut tangents: Vec<Vec<f64>> = Vec::new();
        for j in 0..points.len() / 2 {
            let pair = answers.row(2 * j + 2).iter().zip(answers.row(2 * j + 1));
            let tangent: Vec<f64> = pair.map(|(above, below)| above - below).collect();
            let length = dot(&tangent, &tangent).sqrt();
            let rest = rest(&tangents, tangent);
            let left = dot(&rest, &rest).sqrt();
            if left.is_finite() && left > NEW * length {
                tangents.push(rest.iter().map(|y| y / left).collect());
            }
        }
        Ok(Self { learning, without, tangents })
    }

    /// The reach of the candidate `kind` with these inputs, the size first, in the companion `map` with it: the largest
    /// distance at which the part of its change that the parameters cannot make up for is not far larger than the
    /// misfit. What they make up for may be much larger than what is left of it.
    pub fn of(&self, kind: &str, inputs: &[FreeInput], map: &ModelMap<'_>) -> Result<f64, Stop> {
        let all = distances(&inputs[0]);
        let most = match &self.learning.extent {
            Extent::Sizes(sizes) => {
                let size = sizes.get(kind).map(|size| FAR * (size - inputs[0].absent).abs());
                return Ok(size.filter(|far| *far > 0.0).map_or(all[0], |far| far.min(all[0])));
            }
            Extent::Change(rms) => FAR * rms,
        };
        let (low, high) = inputs[0].prior.support();
        let values = |far: &f64| -> Vec<f64> {
            let above = inputs[0].absent + far;
            let size = if above <= high { above } else { (inputs[0].absent - far).max(low) };
            let index = |input: &FreeInput| input.starts.first().copied().unwrap_or(input.absent);
            std::iter::once(size).chain(inputs[1..].iter().map(index)).collect()
        };
        let values: Vec<Vec<f64>> = all.iter().map(values).collect();
        let point = &self.learning.point;
        let with = self.learning.answers(map, values.iter().map(|own| (point, &own[..])))?;
        let fits = |k: &usize| self.rms(with.row(*k)) <= most;
        Ok((0..all.len()).find(fits).map_or(all[all.len() - 1], |k| all[k]))
    }

    /// The root mean square of the change to a response, without its part along the tangents.
    fn rms(&self, with: &[f64]) -> f64 {
        let change = with.iter().zip(&self.without).map(|(a, b)| a - b).collect();
        let rest = rest(&self.tangents, change);
        (dot(&rest, &rest) / rest.len().max(1) as f64).sqrt()
    }
}

/// A vector without its parts along orthonormal ones.
fn rest(along: &[Vec<f64>], mut vector: Vec<f64>) -> Vec<f64> {
    for one in along {
        let share = dot(one, &vector);
        vector.iter_mut().zip(one).for_each(|(y, x)| *y -= share * x);
    }
    vector
}

//! Archive of past points, from which differential evolution takes its jumps.
//!
//! It is kept in the memory of the state as plain numbers and read in place, because a step needs only two or three
//! of some thousand points.

use lacuna::math::random::{Stream, below};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use rand::Rng;
use serde_json::{Value, json};

use super::proposal::{Shape, normals};

/// Initial points per unknown, as in ter Braak and Vrugt 2008.
const FIRST: usize = 10;
/// Initial interval, in steps, at which the points of the chains are added to the archive.
const EVERY: u64 = 10;
/// Maximum number of points.
const LARGEST: usize = 2000;

/// Number of points in the initial cloud, and of the prior draws added to it.
pub(super) fn first(dimension: usize) -> usize {
    (FIRST * dimension).max(2 * FIRST)
}

/// The archive as read by a step.
pub(super) struct Archive<'a> {
    /// Coordinates of the points, one point after the other.
    places: &'a [Value],
    dimension: usize,
    /// Standard deviation of the initial cloud in each coordinate.
    pub lengths: Vec<f64>,
}

impl<'a> Archive<'a> {
    /// Returns the memory before the first step: a normal cloud around the best starting point, and draws of the
    /// prior.
    ///
    /// `points` has one row per chain, `log_density` one value per chain, `prior` one row per draw.
    pub(super) fn begin(
        shape: &Shape,
        points: &Matrix,
        log_density: &[f64],
        prior: &Matrix,
    ) -> Value {
        let dimension = points.columns();
        let best = (0..points.rows()).max_by(|&a, &b| log_density[a].total_cmp(&log_density[b]));
        let centre = points.row(best.unwrap_or(0));
        // The cloud is part of the proposal, so that a fixed stream is sufficient.
        let mut rng = Stream::root(0).named("archive").generator();
        let mut places = Matrix::zeros(first(dimension), dimension);
        for i in 0..places.rows() {
            let z = normals(dimension, &mut rng);
            shape.step(centre, 1.0, &z, places.row_mut(i));
        }
        prior.iter_rows().for_each(|draw| places.push_row(draw));
        json!({
            "step": 0,
            "every": EVERY,
            "lengths": shape.sd(),
            "places": places.into_vec(),
        })
    }

    /// Reads the archive from the memory of a state; fails if it is incomplete.
    pub(super) fn read(memory: &'a Value, dimension: usize) -> Result<Self, Stop> {
        let places = memory["places"].as_array().map_or(&[][..], Vec::as_slice);
        let lengths = super::chains::numbers(&memory["lengths"]);
        if places.len() < 3 * dimension || lengths.len() != dimension {
            return Err(Stop::new("the saved archive of the chains cannot be read"));
        }
        Ok(Self { places, dimension, lengths })
    }

    /// Draws `N` distinct points of the archive.
    pub(super) fn pick<const N: usize>(&self, rng: &mut impl Rng) -> [Vec<f64>; N] {
        let count = self.places.len() / self.dimension;
        let mut picked = [usize::MAX; N];
        for k in 0..N {
            let mut next = below(rng, count);
            while picked[..k].contains(&next) {
                next = below(rng, count);
            }
            picked[k] = next;
        }
        picked.map(|i| {
            let place = &self.places[i * self.dimension..(i + 1) * self.dimension];
            place.iter().filter_map(Value::as_f64).collect()
        })
    }

    /// Counts a step, and adds the points of the chains to the archive when the interval has passed.
    ///
    /// At the end of the warm-up the older half of the archive is dropped. Above [`LARGEST`] points every second
    /// visit is dropped, and the interval doubles.
    pub(super) fn remember(
        memory: &mut Value,
        points: &Matrix,
        warm_up: usize,
    ) -> Result<(), Stop> {
        let dimension = points.columns();
        let step = memory["step"].as_u64().unwrap_or(0) + 1;
        let every = memory["every"].as_u64().unwrap_or(EVERY).max(1);
        memory["step"] = step.into();
        let Some(places) = memory["places"].as_array_mut() else {
            return Err(Stop::new("the saved archive of the chains cannot be read"));
        };
        if step.is_multiple_of(every) {
            places.extend(points.as_slice().iter().map(|x| Value::from(*x)));
        }
        if step == warm_up as u64 {
            let half = places.len() / dimension / 2;
            if half >= FIRST * dimension {
                places.drain(..half * dimension);
            }
        }
        if places.len() > LARGEST * dimension {
            let visits = places.chunks(points.as_slice().len());
            let kept = visits.skip(1).step_by(2).flatten().cloned().collect();
            *places = kept;
            memory["every"] = (2 * every).into();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn places(memory: &Value) -> usize {
        memory["places"].as_array().unwrap().len() / 2
    }

    #[test]
    fn it_grows_forgets_and_stays_small() {
        let points = Matrix::from_rows(2, [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]);
        let none = Matrix::zeros(0, 2);
        let shape = Shape::diagonal(&[1.0, 1.0]);
        let mut memory = Archive::begin(&shape, &points, &[0.0, 1.0, 0.5], &none);
        assert_eq!(places(&memory), 20);
        let mut sizes = Vec::new();
        for _ in 0..20_000 {
            Archive::remember(&mut memory, &points, 1000).unwrap();
            sizes.push(places(&memory));
        }
        // Three points every ten steps; half of 320 is dropped at the end of the warm-up.
        assert_eq!((sizes[8], sizes[9], sizes[998], sizes[999]), (20, 23, 317, 160));
        assert!(sizes.iter().all(|&n| n <= LARGEST));
        assert!(memory["every"] == 40 && sizes[19_999] > LARGEST / 2, "{}", sizes[19_999]);
        // Every chain keeps its share of the points.
        let archive = Archive::read(&memory, 2).unwrap();
        let firsts: Vec<f64> = archive.places.iter().step_by(2).filter_map(Value::as_f64).collect();
        let count = |x: f64| firsts.iter().filter(|f| **f == x).count();
        assert!(count(1.0).abs_diff(count(3.0)) <= 4 && count(3.0).abs_diff(count(5.0)) <= 4);
    }

    #[test]
    fn picked_places_differ() {
        let points = Matrix::from_rows(2, [[1.0, 2.0], [3.0, 4.0]]);
        let none = Matrix::zeros(0, 2);
        let memory = Archive::begin(&Shape::diagonal(&[1.0, 1.0]), &points, &[0.0, 1.0], &none);
        let archive = Archive::read(&memory, 2).unwrap();
        let mut rng = Stream::root(1).generator();
        for _ in 0..200 {
            let [a, b, c] = archive.pick(&mut rng);
            assert!(a != b && b != c && a != c);
        }
        assert!(Archive::read(&Value::Null, 2).is_err());
    }
}

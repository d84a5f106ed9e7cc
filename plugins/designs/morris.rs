//! `morris`: trajectories for elementary effects.

use lacuna::data::Parameter;
use lacuna::math::random::{Stream, below, permutation};
use lacuna::plugin::{Component, Context, Design};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Trajectories for elementary effects (method of Morris): from a random start one parameter after the other moves,
/// by half of its design's probability.
///
/// Use it to find the parameters that matter among tens or hundreds, before a surrogate is thought of: a trajectory
/// has one run more than there are parameters, and 10 trajectories are usual. With `runs` a multiple of that number
/// all trajectories are complete. The report then lists the mean absolute effect of each parameter (`mu*`) and the
/// standard deviation of its effects (`sigma`); no other design allows that. For a surrogate, `latin_hypercube` or
/// `sobol` is better: here many runs share most of their coordinates.
///
/// Each parameter takes `levels` values, at the middle of slices of equal probability, so that unbounded designs are
/// possible. Each trajectory is the one farthest from those before it among some random ones, and a longer design
/// begins with the shorter one.
///
/// References: Morris, Technometrics 33 (1991) 161; Campolongo, Cariboni and Saltelli, Environmental Modelling and
/// Software 22 (2007) 1509 (`mu*` and the distance between trajectories, there with a choice among all of them at
/// once).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Morris {
    /// Number of levels of each parameter, even and at least 2.
    pub levels: usize,
    /// Number of random trajectories from which each further one is chosen, at least 1.
    pub candidates: usize,
}

impl Default for Morris {
    fn default() -> Self {
        Self { levels: 4, candidates: 20 }
    }
}

impl Morris {
    /// Returns what is wrong with the options: the option, a description, and what is right.
    fn faults(&self) -> Vec<(&'static str, &'static str, usize, &'static str)> {
        let mut faults = Vec::new();
        if self.levels < 2 || !self.levels.is_multiple_of(2) {
            let message = "a step over half of the levels needs an even number of them";
            faults.push(("levels", message, self.levels, "an even number from 2, such as 4"));
        }
        if self.candidates == 0 {
            let message = "there is no trajectory to choose from";
            faults.push(("candidates", message, self.candidates, "a number from 1, such as 20"));
        }
        faults
    }

    /// Returns a random trajectory (`(dimension + 1) x dimension`).
    fn trajectory(&self, dimension: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        let half = self.levels / 2;
        let middle = |level: usize| (level as f64 + 0.5) / self.levels as f64;
        let mut levels: Vec<usize> = (0..dimension).map(|_| below(&mut rng, self.levels)).collect();
        let mut points = Matrix::zeros(0, dimension);
        points.push_row(&levels.iter().map(|&l| middle(l)).collect::<Vec<f64>>());
        for j in permutation(&mut rng, dimension) {
            levels[j] = if levels[j] < half { levels[j] + half } else { levels[j] - half };
            points.push_row(&levels.iter().map(|&l| middle(l)).collect::<Vec<f64>>());
        }
        points
    }

    /// Returns the random trajectory that is farthest from those before.
    fn next(&self, before: &[Matrix], dimension: usize, stream: &Stream) -> Matrix {
        let mut best = self.trajectory(dimension, &stream.at(0));
        if before.is_empty() {
            return best;
        }
        let mut farthest = spread(&best, before);
        for candidate in 1..self.candidates {
            let tried = self.trajectory(dimension, &stream.at(candidate as u64));
            let distance = spread(&tried, before);
            if distance > farthest {
                (best, farthest) = (tried, distance);
            }
        }
        best
    }
}

/// Returns the root of the sum of the squared distances to other trajectories. The distance of two trajectories is
/// the sum of the distances of their points (Campolongo et al. 2007).
fn spread(trajectory: &Matrix, others: &[Matrix]) -> f64 {
    let between =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt();
    let distance = |other: &Matrix| -> f64 {
        trajectory.iter_rows().map(|a| other.iter_rows().map(|b| between(a, b)).sum::<f64>()).sum()
    };
    others.iter().map(|other| distance(other).powi(2)).sum::<f64>().sqrt()
}

impl Component for Morris {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for (key, message, found, expected) in self.faults() {
            complaints.at(key).say(message).expected(expected).found(found);
        }
        let least = context.parameters.len() + 1;
        if let Some(runs) = context.runs.filter(|&runs| runs < least) {
            complaints
                .at("runs")
                .say("there are fewer runs than one trajectory has")
                .expected(format!("a multiple of {least}, such as {}", 10 * least))
                .found(runs);
        }
    }
}

impl Design for Morris {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        if let Some((key, message, ..)) = self.faults().into_iter().next() {
            return Err(Stop::new(format!("`design.{key}`: {message}")));
        }
        let mut points = Matrix::zeros(0, dimension);
        let mut trajectories: Vec<Matrix> = Vec::new();
        while points.rows() < count && dimension > 0 {
            let stream = stream.at(trajectories.len() as u64);
            let next = self.next(&trajectories, dimension, &stream);
            let room = count - points.rows();
            next.iter_rows().take(room).for_each(|point| points.push_row(point));
            trajectories.push(next);
        }
        Ok(points)
    }

    fn extend(
        &self,
        _: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        super::next_of_sequence(self, known, count, stream)
    }
}

lacuna::register!(Design, "morris", Morris, aliases: ["elementary_effects"]);

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::design("morris", &Morris::default()), Ok(()));
    }

    /// In each trajectory every parameter moves once, by half of the levels, and all levels are used alike.
    #[test]
    fn every_parameter_moves_once_in_a_trajectory() {
        let points = Morris::default().points(30 * 8, 7, &Stream::root(1)).unwrap();
        let mut counts = [0; 4];
        for trajectory in points.as_slice().chunks(8 * 7) {
            let mut moved = vec![0; 7];
            for pair in 0..7 {
                let (a, b) = (&trajectory[7 * pair..][..7], &trajectory[7 * (pair + 1)..][..7]);
                for j in (0..7).filter(|&j| a[j] != b[j]) {
                    moved[j] += 1;
                    assert!(((a[j] - b[j]).abs() - 0.5).abs() < 1e-15);
                }
            }
            assert_eq!(moved, [1; 7]);
            trajectory[..7].iter().for_each(|x| counts[(x * 4.0) as usize] += 1);
        }
        // 210 starting levels: each is expected 52.5 times, with a standard deviation of 6.3.
        assert!(counts.iter().all(|&n| (27..=78).contains(&n)), "{counts:?}");
    }

    /// Trajectories that were chosen are farther apart than random ones (Campolongo et al. 2007, figure 2).
    #[test]
    fn chosen_trajectories_are_farther_apart() {
        let apart = |candidates: usize| {
            let design = Morris { candidates, ..Morris::default() };
            let points = design.points(4 * 6, 5, &Stream::root(2)).unwrap();
            let all: Vec<Matrix> = points
                .as_slice()
                .chunks(6 * 5)
                .map(|part| Matrix::from_vec(6, 5, part.to_vec()))
                .collect();
            (0..4).map(|k| spread(&all[k], &all[..k])).sum::<f64>()
        };
        assert!(apart(20) > 1.02 * apart(1), "{} {}", apart(20), apart(1));
    }
}

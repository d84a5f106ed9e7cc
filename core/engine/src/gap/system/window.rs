//! The first part of each curve: a window in which a fit begins.

use super::System;
use super::fit::Fit;

/// The values of a record that count in a fit: the first ones of each curve.
pub(super) struct Window {
    /// Outputs that do not count.
    beyond: Vec<usize>,
}

impl Window {
    /// The first part of each curve, as a share of the length of its axis.
    pub fn of(system: &System<'_>, share: f64) -> Self {
        let beyond = system.experiment.curves.iter().flat_map(|curve| {
            let places = curve.measured.iter().zip(&curve.at);
            let first = curve.at.first().copied().unwrap_or(0.0);
            let last = curve.at.last().copied().unwrap_or(0.0);
            let end = first + share * (last - first);
            places.filter(move |(_, at)| **at > end).map(|(i, _)| *i)
        });
        Self { beyond: beyond.collect() }
    }

    /// The system, of whose responses only the values that count are needed.
    pub fn of_system<'a>(&self, system: &System<'a>) -> System<'a> {
        let mut needed = system.experiment.measured();
        self.beyond.iter().for_each(|&i| needed[i] = false);
        system.at_outputs(needed)
    }

    /// Number of values that do not count.
    pub fn beyond(&self) -> usize {
        self.beyond.len()
    }

    /// Whitened values of which those beyond the window are zero. Whitening goes along the curves, so that the others
    /// have the density of the data in the window if the errors are those of the single curves.
    pub fn cut(&self, white: &mut [f64]) {
        self.beyond.iter().for_each(|&i| white[i] = 0.0);
    }

    /// A fit to the values that count.
    pub fn of_fit(&self, mut fit: Fit) -> Fit {
        self.cut(&mut fit.residual);
        for j in 0..fit.slopes.rows() {
            self.cut(fit.slopes.row_mut(j));
        }
        if fit.log_density.is_finite() {
            let square: f64 = fit.residual.iter().map(|z| z * z).sum();
            fit.log_density = fit.log_prior - 0.5 * square;
        }
        fit
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f64::consts::TAU;

    use lacuna::data::{Measurements, Replicate};
    use lacuna::math::distribution::Distribution;
    use lacuna::math::random::{Stream, normal};
    use lacuna::plugin::Forward;
    use lacuna_linalg::Matrix;

    use crate::gap::experiment::Experiment;
    use crate::gap::system::System;
    use crate::gap::system::fit::{fit, fit_from};
    use crate::gap::system::whitener::Whitener;
    use crate::gap::testing::SyntheticExperiment;

    /// Number of points, at a distance of one; a period has about 13 of them.
    const POINTS: usize = 1200;

    /// `amplitude sin(frequency t)`.
    struct Wave;

    impl Forward for Wave {
        fn dimension(&self) -> usize {
            2
        }
        fn outputs(&self) -> usize {
            POINTS
        }
        fn mean(&self, points: &Matrix) -> Matrix {
            let wave = |i: usize, t: usize| points[(i, 0)] * (points[(i, 1)] * t as f64).sin();
            Matrix::from_fn(points.rows(), POINTS, wave)
        }
        fn jacobian(&self, point: &[f64]) -> Matrix {
            Matrix::from_fn(POINTS, 2, |t, j| {
                let t = t as f64;
                let (sine, cosine) = (point[1] * t).sin_cos();
                if j == 0 { sine } else { point[0] * t * cosine }
            })
        }
    }

    /// Over 90 periods a frequency that is off by 4 % leads to the phase of another period. The Cramér-Rao bound of a
    /// frequency is `24 noise^2 / (amplitude^2 n^3)` (Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974) 591, with known
    /// phase: a quarter of it).
    #[test]
    fn a_growing_window_finds_the_phase_of_a_long_record() {
        let mut world =
            SyntheticExperiment::new(&["c"], &["s"], POINTS, 0.0, &["a", "f"], |_, _, _, _| 0.0);
        world.parameters[0].prior = Distribution::Normal([20.0, 10.0]);
        world.parameters[1].prior = Distribution::Normal([0.47, 0.05]);
        let truth = TAU * 90.0 / POINTS as f64;
        let mut rng = Stream::root(4).generator();
        let values = (0..POINTS).map(|t| Some(20.0 * (truth * t as f64).sin() + normal(&mut rng)));
        let replicate = Replicate::new("1", values.collect());
        let measured = Measurements::new(world.layouts.blocks[0].clone(), vec![replicate]).into();
        let experiment = Experiment::new(&world.layouts, &world.parameters, &Wave, &measured);
        let (_, means) = experiment.means();
        let whitener = Whitener::new(&experiment, &world.noise, &means);
        let system = System::new(&experiment, Vec::new());
        let sd = (24.0_f64 / (4.0 * 400.0 * (POINTS as f64).powi(3))).sqrt();
        for off in [0.96, 0.98, 1.03] {
            let start = vec![10.0, off * truth];
            let alone = fit(&system, &whitener, &means, &start).at.point[1];
            assert!((alone - truth).abs() > 100.0 * sd, "the case is too easy: {alone}");
            let found = fit_from(&system, &whitener, &means, &[start]).unwrap().at.point[1];
            assert!((found - truth).abs() < 4.0 * sd, "{off}: {found}, {truth} ± {sd}");
        }
    }
}

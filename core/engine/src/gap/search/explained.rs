//! The part of a misfit that effects explain.

use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

use super::verdict::CLEAR;
use crate::gap::system::fit::Fit;
use crate::gap::system::remainder::{Setting, WhiteRemainder};

/// A misfit of some outputs, as energies in units of the noise of the mean.
///
/// What effects close is the difference of two sums of squares under the same noise and does not depend on how large
/// that noise is said to be. The sum of squares before them, less its expectation, does: an effect on a thousand values
/// whose noise is overestimated by a few per cent would close more than there is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Explained {
    /// The energy that the effects take away beyond what they would take from noise.
    pub closed: f64,
    /// The energy that is left: what a remainder takes out of the residual, or the clear excess of the residual over
    /// noise, if that is larger.
    pub left: f64,
}

impl Explained {
    /// The part of the misfit `before` that is closed in the fit `after`, whose remainder of largest evidence is
    /// `setting`, on the outputs where `acts` is true. Both fits have the noise of `white`.
    pub fn of(
        white: &WhiteRemainder,
        [before, after]: [&Fit; 2],
        setting: Option<Setting>,
        acts: &[bool],
    ) -> Self {
        let unknowns = after.at.point.len().saturating_sub(before.at.point.len()) as f64;
        let [all, rest] = [before, after].map(|fit| square(fit, acts));
        let values = acts.iter().filter(|acts| **acts).count() as f64;
        let excess = rest - values - CLEAR * (2.0 * values).sqrt();
        Self {
            closed: all - rest - unknowns,
            left: white.energy_on(after, setting, acts).max(excess).max(0.0),
        }
    }

    /// The energy of the whole misfit.
    pub fn total(&self) -> f64 {
        self.closed.max(0.0) + self.left
    }

    /// The share of the misfit that is closed, at most 1; 0 if there is no misfit.
    pub fn share(&self) -> f64 {
        self.closed / self.total().max(1.0)
    }
}

/// The squared whitened residual of some outputs.
fn square(fit: &Fit, acts: &[bool]) -> f64 {
    let own: Vec<f64> =
        fit.residual.iter().zip(acts).filter(|(_, acts)| **acts).map(|(z, _)| *z).collect();
    dot(&own, &own)
}

/// The squared whitened residual of some outputs, less its expectation.
pub(super) fn misfit(fit: &Fit, acts: &[bool]) -> f64 {
    let values = acts.iter().filter(|acts| **acts).count() as f64;
    (square(fit, acts) - values).max(0.0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use lacuna::math::random::Stream;
    use lacuna_linalg::{Cholesky, Matrix};

    use super::*;
    use crate::gap::noise::Noise;
    use crate::gap::system::System;
    use crate::gap::system::fit::fit;
    use crate::gap::system::remainder::Remainder;
    use crate::gap::system::whitener::Whitener;
    use crate::gap::testing::SyntheticExperiment;

    const TIMES: usize = 60;
    const SENSORS: [&str; 4] = ["a", "b", "c", "d"];

    /// A level, and a wave on all sensors; with white noise of standard deviation one.
    fn world(names: &[&str]) -> SyntheticExperiment {
        SyntheticExperiment::new(&["x"], &SENSORS, TIMES, 0.0, names, |j, _, s, t| match j {
            0 => 1.0,
            _ => (0.3 * t + s as f64).sin(),
        })
    }

    /// The noise with standard deviations this many times as large.
    fn louder(noise: &Noise, factor: f64) -> Noise {
        let mut noise = noise.clone();
        noise.curves.iter_mut().for_each(|curve| curve.sd *= factor);
        noise
    }

    /// The part that the wave of a truth of this size closes, with noise that is overestimated by a factor, and what the fits leave:
    /// the sums of squares of the normal equations with the prior, by dense algebra.
    fn told(size: f64, factor: f64, acts: &[bool]) -> (Explained, [f64; 2]) {
        let worlds = [world(&["level"]), world(&["level", "wave"])];
        let truth = worlds[1].response(&[0.4, size]);
        let experiments = worlds.each_ref().map(|w| w.experiment(&truth, 3, &Stream::root(5)));
        let noise = louder(&worlds[0].noise, factor);
        let means = experiments[0].means().1;
        let whitener = Whitener::new(&experiments[0], &noise, &means);
        let fits = [0, 1].map(|k| {
            let system = System::new(&experiments[k], Vec::new());
            fit(&system, &whitener, &means, &vec![0.0; k + 1])
        });
        let system = System::new(&experiments[0], Vec::new());
        let around = system.around(&fits[0].at);
        let white = Remainder::of(&experiments[0], &noise, &around).white(&whitener);
        let best = |fit: &Fit| white.evidences(fit).unwrap().best();
        let [before, after] = &fits;
        let explained = Explained::of(&white, [before, after], best(after), acts);
        let weight = 3.0 / (factor * factor);
        let squares = [0, 1].map(|k| {
            let slopes = &worlds[k].forward.slopes;
            let inner = Matrix::from_fn(k + 1, k + 1, |i, j| {
                let product: f64 =
                    slopes.row(i).iter().zip(slopes.row(j)).map(|(a, b)| a * b).sum();
                weight * product + f64::from(u8::from(i == j))
            });
            let mut right: Vec<f64> =
                (0..=k).map(|i| weight * dot(slopes.row(i), &means)).collect();
            Cholesky::new(&inner).unwrap().solve(&mut right);
            let fitted = worlds[k].response(&right);
            weight * means.iter().zip(fitted).map(|(y, m)| (y - m).powi(2)).sum::<f64>()
        });
        (explained, squares)
    }

    /// A wave of half a standard deviation of the mean on 240 values, whose noise is overestimated by a fifth: the sum of
    /// squares is below its expectation before the wave is fitted, and the wave still closes what there is.
    #[test]
    fn an_effect_on_everything_closes_the_misfit_though_the_noise_is_overestimated() {
        let all = vec![true; TIMES * SENSORS.len()];
        for factor in [1.0, 1.2] {
            let (explained, [before, after]) = told(0.4, factor, &all);
            assert!(
                (explained.closed - (before - after - 1.0)).abs() < 1e-6 * before,
                "{explained:?}"
            );
            assert!(explained.share() > 0.9 && explained.closed > 20.0, "{explained:?}");
            assert_eq!(before > all.len() as f64, factor == 1.0, "{before}");
        }
    }

    /// Nothing to close: the share is near zero, not a ratio of two small numbers.
    #[test]
    fn nothing_is_closed_where_nothing_is_missing() {
        let all = vec![true; TIMES * SENSORS.len()];
        let (explained, _) = told(0.0, 1.0, &all);
        // The square of one normal variable less one: at most 8 but for one case in a thousand.
        assert!(explained.closed.abs() < 8.0 && explained.share() <= 1.0, "{explained:?}");
    }

    /// Without an effect all of the misfit is left: at the fit without the wave, the energy on all outputs is that of the
    /// remainder, and the clear excess of a large wave is counted.
    #[test]
    fn what_no_effect_closes_is_left() {
        let level = world(&["level"]);
        let truth = world(&["level", "wave"]).response(&[0.4, 2.0]);
        let experiment = level.experiment(&truth, 3, &Stream::root(5));
        let means = experiment.means().1;
        let whitener = Whitener::new(&experiment, &level.noise, &means);
        let system = System::new(&experiment, Vec::new());
        let found = fit(&system, &whitener, &means, &[0.0]);
        let around = system.around(&found.at);
        let white = Remainder::of(&experiment, &level.noise, &around).white(&whitener);
        let best = white.evidences(&found).unwrap().best();
        let all = vec![true; TIMES * SENSORS.len()];
        let energy = white.energy(&found, best);
        assert!((white.energy_on(&found, best, &all) - energy).abs() < 1e-9 * energy);
        let explained = Explained::of(&white, [&found, &found], best, &all);
        assert!(explained.closed == 0.0 && explained.share() == 0.0, "{explained:?}");
        let excess = square(&found, &all) - all.len() as f64;
        assert!(
            explained.left >= energy && explained.left > 0.8 * excess,
            "{explained:?} {excess}"
        );
    }

    /// The energies of the sensors add up to that of all.
    #[test]
    fn the_parts_add_up() {
        let each = |s: usize| -> Vec<bool> {
            (0..TIMES * SENSORS.len()).map(|i| i / TIMES == s).collect()
        };
        let all = told(0.8, 1.0, &vec![true; TIMES * SENSORS.len()]).0.closed;
        let parts: f64 = (0..SENSORS.len()).map(|s| told(0.8, 1.0, &each(s)).0.closed + 1.0).sum();
        assert!((parts - (all + 1.0)).abs() < 1e-6 * all, "{parts} {all}");
    }
}

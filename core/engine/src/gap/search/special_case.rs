//! Special cases of laws, fitted also from where a law that contains them is.
//!
//! A refit begins at the calibrated unknowns without an effect. Of an oscillation over many periods the misfit has many
//! minima, and a term may be led to another one than the law of which it is a special case: then the law is named for
//! the minimum that it found. Where the law is ahead, its calibrated unknowns are starts of the special case too.

use lacuna::math::distribution::Distribution;
use lacuna_linalg::vector::dot;
use rayon::prelude::*;

use super::refit::{RefitSetting, Scored};
use crate::gap::system::System;
use crate::gap::system::fit::{Begun, Fit, residual};
use crate::gap::system::whitener::Whitener;

/// The lead in log density with which a law gives starts to its special cases. A law follows noise with its further
/// unknown by half a unit on average.
const AHEAD: f64 = 3.0;

/// The number of sizes on each side of zero at which a special case is tried, each smaller than the one before by
/// [`RATIO`]: over a factor of 600.
const SIZES: i32 = 20;
const RATIO: f64 = 1.4;

/// The number of sizes from which it is fitted: those nearest to the data.
const STARTS: usize = 2;

impl RefitSetting<'_, '_> {
    /// Fits the placements again, each from the best law that contains it, where such a law is ahead; the better fit is
    /// kept. `fits` are those of `systems`, by their indices.
    pub(super) fn fit_special_cases(
        &self,
        scored: &[Scored],
        systems: &[System<'_>],
        fits: &mut [(usize, Fit)],
    ) {
        let again: Vec<Option<Fit>> = fits
            .par_iter()
            .map(|(i, fit)| {
                let law = self.law_ahead(scored, &scored[*i], fit, fits)?;
                let unknowns = &law.at.point[..self.system.dimension()];
                let (whitener, means) = (self.whitener, self.means);
                let starts =
                    of_sizes(&systems[*i], whitener, means, unknowns, &scored[*i].starts[0]);
                let found = Begun::from(&systems[*i], whitener, means, &starts)?;
                found.finished(fit.log_density).filter(|found| found.log_density > fit.log_density)
            })
            .collect();
        for ((_, fit), again) in fits.iter_mut().zip(again) {
            if let Some(again) = again {
                *fit = again;
            }
        }
    }

    /// The fit of largest density of a law that contains a placement as a special case and acts at its place.
    fn law_ahead<'f>(
        &self,
        scored: &[Scored],
        own: &Scored,
        fit: &Fit,
        fits: &'f [(usize, Fit)],
    ) -> Option<&'f Fit> {
        let kind = self.candidates[own.placement.candidate].kind.as_str();
        let is_law = |other: &Scored| {
            other.placement.on == own.placement.on
                && self.candidates[other.placement.candidate].contains.contains(&kind)
        };
        fits.iter()
            .filter(|(j, law)| is_law(&scored[*j]) && law.log_density > fit.log_density + AHEAD)
            .map(|(_, law)| law)
            .max_by(|a, b| a.log_density.total_cmp(&b.log_density))
    }
}

/// The starts at these unknowns with the sizes nearest to the data; `own` are unknowns of the effect, its size first.
fn of_sizes(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    unknowns: &[f64],
    own: &[f64],
) -> Vec<Vec<f64>> {
    let at = unknowns.len();
    let bounds = system.bounds();
    let start = |size: f64| -> Vec<f64> {
        let own = std::iter::once(&size).chain(&own[1..]);
        let point = unknowns.iter().chain(own).zip(&bounds);
        point.map(|(x, (low, high))| x.clamp(*low, *high)).collect()
    };
    let starts: Vec<Vec<f64>> = sizes(&system.priors()[at]).into_iter().map(start).collect();
    let squares = system.responses(&starts).into_iter().map(|response| {
        let z = whitener.whiten(&residual(means, &response));
        dot(&z, &z)
    });
    let mut order: Vec<(f64, usize)> =
        squares.zip(0..).filter(|(square, _)| square.is_finite()).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.into_iter().take(STARTS).map(|(_, i)| starts[i].clone()).collect()
}

/// Sizes between the quantiles 2.5 and 97.5 % of a prior on a logarithmic scale, on each side of zero that it has.
fn sizes(prior: &Distribution) -> Vec<f64> {
    let quantiles = [0.025, 0.975].map(|p| prior.quantile(p));
    let inside = |size: &f64| (quantiles[0]..=quantiles[1]).contains(size);
    let of_side = |end: f64| (0..SIZES).map(move |k| end * RATIO.powi(-k));
    quantiles.into_iter().flat_map(of_side).filter(inside).collect()
}

#[cfg(test)]
mod tests {
    use lacuna::data::{Measurements, Replicate};
    use lacuna::math::random::{Stream, normal};
    use lacuna::plugin::Forward;
    use lacuna_linalg::Matrix;

    use super::*;
    use crate::gap::experiment::Experiment;
    use crate::gap::system::fit::fit;
    use crate::gap::testing::SyntheticExperiment;

    const POINTS: usize = 200;

    /// An oscillation `cos(f t + k t^2 / 200)`, whose phase at its end a size `k` moves.
    struct Sweep;

    impl Forward for Sweep {
        fn dimension(&self) -> usize {
            2
        }
        fn outputs(&self) -> usize {
            POINTS
        }
        fn mean(&self, points: &Matrix) -> Matrix {
            Matrix::from_fn(points.rows(), POINTS, |i, j| {
                let t = j as f64;
                phase(points.row(i), t).cos()
            })
        }
        fn jacobian(&self, point: &[f64]) -> Matrix {
            Matrix::from_fn(POINTS, 2, |j, p| {
                let t = j as f64;
                let by = if p == 0 { t } else { t * t / POINTS as f64 };
                -phase(point, t).sin() * by
            })
        }
    }

    fn phase(point: &[f64], t: f64) -> f64 {
        point[0] * t + point[1] * t * t / POINTS as f64
    }

    /// Closed form: the data have the frequency 0.5 and the size 0.05. From the frequency without the size, 0.9, the search
    /// ends in another minimum; from the frequency of the law, near 0.5, the sizes lead to it.
    #[test]
    fn a_special_case_is_found_from_where_the_law_is() {
        let mut world =
            SyntheticExperiment::new(&["c"], &["s"], POINTS, 0.0, &["f", "k"], |_, _, _, _| 0.0);
        world.parameters[0].prior = Distribution::Normal([0.5, 1.0]);
        world.parameters[1].prior = Distribution::Normal([0.0, 1.0]);
        for curve in &mut world.noise.curves {
            curve.sd = 0.05;
        }
        let mut rng = Stream::root(2).generator();
        let values = (0..POINTS)
            .map(|t| Some(phase(&[0.5, 0.05], t as f64).cos() + 0.05 * normal(&mut rng)));
        let replicate = Replicate::new("1", values.collect());
        let measured = Measurements::new(world.layouts.blocks[0].clone(), vec![replicate]).into();
        let experiment = Experiment::new(&world.layouts, &world.parameters, &Sweep, &measured);
        let (_, means) = experiment.means();
        let whitener = Whitener::new(&experiment, &world.noise, &means);
        let system = System::new(&experiment, Vec::new());
        let usual = fit(&system, &whitener, &means, &[0.9, 0.0]);
        assert!(usual.misfit() > 10.0 * POINTS as f64, "{}", usual.misfit());
        let starts = of_sizes(&system, &whitener, &means, &[0.502], &[0.0]);
        let found = fit(&system, &whitener, &means, &starts[0]);
        let point = &found.at.point;
        assert!((point[0] - 0.5).abs() < 1e-3 && (point[1] - 0.05).abs() < 1e-3, "{point:?}");
    }

    #[test]
    fn sizes_lie_inside_the_prior_on_both_sides() {
        let both = sizes(&Distribution::Normal([0.0, 1.0]));
        assert_eq!(both.len(), 40);
        assert!(both.iter().all(|size| size.abs() < 1.96 && size.abs() > 1.95 / 600.0), "{both:?}");
        let positive = sizes(&Distribution::Uniform([0.0, 2.0]));
        assert!(positive.iter().all(|size| (0.05..2.0).contains(size)), "{positive:?}");
        assert!(!positive.is_empty());
    }
}

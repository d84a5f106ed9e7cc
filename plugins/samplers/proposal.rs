//! Proposals of random walks.

use lacuna::math::moments::{quantile, sorted};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Target;
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::{Cholesky, Matrix};
use lacuna_optimise::{laplace, maximise};
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::chains;

/// Number of prior draws from which the prior's width is estimated.
const PRIOR_DRAWS: usize = 1000;

/// Source of the initial proposal covariance of a random walk.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Proposal {
    /// The inverse curvature of the log density at the maximum reached from the best starting point. If the density
    /// has no gradient or the curvature cannot be used, the prior's width takes its place.
    Curvature,
    /// This fraction of the prior's width in each unknown (half the distance between the 16 % and 84 % quantiles),
    /// without correlations.
    Prior(f64),
}

impl Proposal {
    /// Reports a fraction that is not above zero.
    pub(super) fn check(self, complaints: &mut Complaints<'_>) {
        if let Self::Prior(fraction) = self {
            chains::check_positive("proposal", fraction, complaints);
        }
    }

    /// Returns the initial shape, and the number of evaluations of density and gradient it took. `points` has one row
    /// per chain.
    pub(super) fn shape(
        self,
        target: &dyn Target,
        points: &Matrix,
        log_density: &[f64],
    ) -> Result<(Shape, u64), Stop> {
        let widths = widths(target, points)?;
        let fraction = match self {
            Self::Prior(fraction) => fraction,
            Self::Curvature => {
                if let Some(found) = curvature(target, points, log_density, &widths) {
                    return Ok(found);
                }
                1.0
            }
        };
        if !(fraction > 0.0 && fraction.is_finite()) {
            return Err(Stop::new(format!(
                "expected a fraction of the prior above 0 in `proposal` of the sampler, \
                 found {fraction}"
            )));
        }
        Ok((Shape::diagonal(&widths.iter().map(|w| fraction * w).collect::<Vec<_>>()), 0))
    }
}

/// Returns the prior's width in each coordinate; that of the starting points if the prior's is zero or infinite.
fn widths(target: &dyn Target, points: &Matrix) -> Result<Vec<f64>, Stop> {
    // The draws only serve to estimate a width, so that a fixed stream is sufficient.
    let prior = target.prior_draws(PRIOR_DRAWS, &Stream::root(0).named("proposal"));
    let width = |draws: &Matrix, j: usize| {
        let column = sorted(&draws.column(j));
        0.5 * (quantile(&column, 0.84) - quantile(&column, 0.16))
    };
    let usable = |width: &f64| *width > 0.0 && width.is_finite();
    (0..target.dimension())
        .map(|j| {
            [&prior, points]
                .into_iter()
                .map(|draws| width(draws, j))
                .find(usable)
                .ok_or_else(|| Stop::new(format!("the prior of coordinate {} has no width", j + 1)))
        })
        .collect()
}

fn curvature(
    target: &dyn Target,
    points: &Matrix,
    log_density: &[f64],
    widths: &[f64],
) -> Option<(Shape, u64)> {
    let best = (0..points.rows()).max_by(|&a, &b| log_density[a].total_cmp(&log_density[b]))?;
    let maximum = maximise(target, &points.select_rows(&[best])).into_iter().next()?;
    let laplace = laplace(target, &maximum.point).ok()?;
    let shape = if laplace.definite {
        Shape::of(&laplace.covariance)
    } else {
        // The log density does not fall in some direction: standard deviations are limited to the prior's width.
        let sd = |j: usize| laplace.covariance[(j, j)].sqrt().min(widths[j]);
        Some(Shape::diagonal(&(0..widths.len()).map(sd).collect::<Vec<_>>()))
    };
    let evaluations = maximum.evaluations + 2 * widths.len();
    Some((shape.filter(Shape::is_sound)?, evaluations as u64))
}

/// Shape of a normal proposal: the lower Cholesky factor `L` of its covariance `L L'`, stored row by row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Shape {
    lower: Vec<f64>,
}

impl Shape {
    /// Factors a covariance (`d x d`); `None` if it is not positive definite.
    pub(super) fn of(covariance: &Matrix) -> Option<Self> {
        let factor = Cholesky::new(covariance).ok()?;
        let rows = factor.lower().iter_rows().enumerate();
        Some(Self { lower: rows.flat_map(|(i, row)| row[..=i].to_vec()).collect() })
    }

    /// Returns the shape of independent coordinates with these standard deviations.
    pub(super) fn diagonal(sd: &[f64]) -> Self {
        let row = |i: usize| (0..=i).map(move |j| if i == j { sd[i] } else { 0.0 });
        Self { lower: (0..sd.len()).flat_map(row).collect() }
    }

    /// Restores a shape from the numbers kept in a state.
    pub(super) fn from_numbers(lower: Vec<f64>) -> Self {
        Self { lower }
    }

    /// Returns the numbers to keep in a state.
    pub(super) fn into_numbers(self) -> Vec<f64> {
        self.lower
    }

    fn is_sound(&self) -> bool {
        self.lower.iter().all(|x| x.is_finite()) && self.sd().iter().all(|sd| *sd > 0.0)
    }

    /// Iterates over the rows of the factor, of lengths 1, 2, 3, ...
    fn rows(&self) -> impl Iterator<Item = &[f64]> {
        let mut rest = self.lower.as_slice();
        let mut length = 0;
        std::iter::from_fn(move || {
            length += 1;
            let (row, after) = rest.split_at_checked(length)?;
            rest = after;
            Some(row)
        })
    }

    /// Returns the standard deviation of each coordinate.
    pub(super) fn sd(&self) -> Vec<f64> {
        self.rows().map(|row| row.iter().map(|x| x * x).sum::<f64>().sqrt()).collect()
    }

    /// Writes `x + scale L z` into `new`.
    pub(super) fn step(&self, x: &[f64], scale: f64, z: &[f64], new: &mut [f64]) {
        for ((new, x), row) in new.iter_mut().zip(x).zip(self.rows()) {
            *new = x + scale * row.iter().zip(z).map(|(l, z)| l * z).sum::<f64>();
        }
    }
}

/// Draws independent standard normal numbers.
pub(super) fn normals(count: usize, rng: &mut impl Rng) -> Vec<f64> {
    (0..count).map(|_| normal(rng)).collect()
}

/// Returns the factor on standard deviations, `2.38 / sqrt(d)`, that is optimal for random walks on normal densities
/// of many dimensions (Roberts, Gelman and Gilks, Ann. Appl. Probab. 7 (1997) 110).
pub(super) fn best_scale(dimension: usize) -> f64 {
    2.38 / (dimension.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lacuna::math::distribution::Distribution;

    use super::super::truth::Density;
    use super::*;

    /// A normal density with correlation 0.8 and standard deviations 2 and 1e-3.
    fn normal_law() -> Density<impl Fn(&[f64]) -> f64 + Sync> {
        let priors = vec![Distribution::Normal([0.0, 10.0]), Distribution::Normal([0.0, 1e-2])];
        Density::new(priors, |x: &[f64]| {
            let (u, v) = (x[0] / 2.0, x[1] / 1e-3);
            -0.5 * (u * u + v * v - 1.6 * u * v) / 0.36
        })
    }

    fn shape(target: &dyn Target, proposal: Proposal) -> (Shape, u64) {
        let points = target.prior_draws(4, &Stream::root(1));
        proposal.shape(target, &points, &target.log_density(&points)).unwrap()
    }

    #[test]
    fn the_curvature_of_a_normal_law_is_its_covariance() {
        let (shape, evaluations) = shape(&normal_law(), Proposal::Curvature);
        let found = shape.into_numbers();
        // The Cholesky factor of [[4, 1.6e-3], [1.6e-3, 1e-6]].
        for (found, expected) in found.iter().zip([2.0, 0.8e-3, 0.6e-3]) {
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} and {expected}");
        }
        assert!(evaluations > 0);
    }

    #[test]
    fn a_fraction_of_the_prior_is_as_wide() {
        let (shape, evaluations) = shape(&normal_law(), Proposal::Prior(0.1));
        // Half the distance between the 16 % and 84 % quantiles of a normal distribution is 0.9945 sd; its error with
        // 1000 draws is about 3.5 %.
        for (found, expected) in shape.sd().iter().zip([0.9945, 0.9945e-3]) {
            assert!((found / expected - 1.0).abs() < 0.14, "{found} and {expected}");
        }
        assert_eq!(evaluations, 0);
    }

    #[test]
    fn the_prior_takes_the_place_of_a_curvature_that_is_not_there() {
        let priors = vec![Distribution::Uniform([0.0, 2.0])];
        let bounds = vec![(0.0, 2.0)];
        let inside = |x: &[f64]| (0.0..=2.0).contains(&x[0]);
        let flat = Density {
            priors: priors.clone(),
            bounds: bounds.clone(),
            function: |x: &[f64]| if inside(x) { 0.0 } else { f64::NEG_INFINITY },
        };
        let edge = Density {
            priors,
            bounds,
            function: |x: &[f64]| if inside(x) { 0.0 } else { f64::NAN },
        };
        for sd in [shape(&flat, Proposal::Curvature), shape(&edge, Proposal::Curvature)] {
            assert!(sd.0.sd()[0] > 0.5 && sd.0.sd()[0] < 0.8, "{sd:?}");
        }
    }

    #[test]
    fn steps_have_the_covariance_of_the_shape() {
        let covariance = Matrix::from_rows(2, [[4.0, -1.0], [-1.0, 1.0]]);
        let shape = Shape::of(&covariance).unwrap();
        let (mut rng, n) = (Stream::root(2).generator(), 20_000);
        let steps = (0..n).map(|_| {
            let mut new = [0.0; 2];
            shape.step(&[3.0, -1.0], 2.0, &normals(2, &mut rng), &mut new);
            new
        });
        let moments = lacuna::math::moments::Moments::of_rows(&Matrix::from_rows(2, steps));
        // The variance of a sample covariance is (c_ij^2 + c_ii c_jj) / n; here of 16, -4, 4.
        let found = moments.covariance();
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            let c = |i, j| 4.0 * covariance[(i, j)];
            let error = ((c(i, j) * c(i, j) + c(i, i) * c(j, j)) / f64::from(n)).sqrt();
            assert!((found[(i, j)] - c(i, j)).abs() < 4.0 * error, "{i} {j}: {found:?}");
        }
    }
}

//! Evidence of a posterior from its draws.
//!
//! Bridge sampling (Meng and Wong, Statistica Sinica 6 (1996) 831) compares the unnormalised density with a normal
//! distribution fitted to other draws of it, in unconstrained coordinates (Gronau et al., J. Math. Psychol. 81 (2017)
//! 80). Laplace's approximation needs only the maximum.

use lacuna::data::Draws;
use lacuna::diagnose::{autocorrelation, chains};
use lacuna::math::moments::{Moments, mean, quantile, sorted, variance};
use lacuna::math::random::{Stream, normal};
use lacuna::math::special::HALF_LN_TWO_PI;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use lacuna::plugin::sampler::Evidence;
use lacuna_linalg::{Cholesky, Matrix};
use lacuna_optimise::laplace;

/// Number of steps per chain below which the autocorrelation cannot be estimated.
const FEWEST_STEPS: usize = 20;
/// Relative change at which the iteration has converged, and number of iterations after which it is given up.
const CONVERGED: f64 = 1e-10;
const ITERATIONS: usize = 1000;

/// Log evidence of a target from its draws after burn-in, as [`Bridge`] estimates it.
///
/// # Errors
/// Reason why the evidence cannot be estimated.
pub fn bridge(target: &dyn Target, draws: &Draws, stream: &Stream) -> Result<Evidence, String> {
    let bridge = Bridge::new(target, draws, stream)?;
    bridge.evidence(&bridge.log_density(0..bridge.count()))
}

/// Estimate of the log evidence of a target from its draws after burn-in, in steps.
///
/// The first half of each chain is used to fit the normal distribution; the second half and as many draws from that
/// distribution enter the estimate, weighted by the effective sample size of the chains. The standard error is that of
/// Frühwirth-Schnatter (Econometrics Journal 7 (2004) 143, equation 23), with the autocorrelation of the chains; it
/// does not include the error of draws that have not converged or miss a mode.
pub struct Bridge<'a> {
    free: Unconstrained<'a>,
    proposal: Normal,
    /// Draws of the target.
    points: Matrix,
    /// As many draws from the proposal.
    drawn: Matrix,
    /// Number of steps of each chain in `points`.
    steps: usize,
}

impl<'a> Bridge<'a> {
    /// The draws at which the density of the target is needed.
    ///
    /// # Errors
    /// Reason why the evidence cannot be estimated.
    pub fn new(target: &'a dyn Target, draws: &Draws, stream: &Stream) -> Result<Self, String> {
        let (d, half) = (draws.dimension(), draws.steps / 2);
        if half < FEWEST_STEPS || draws.chains * half < 10 * (d + 1) {
            return Err(format!(
                "{} draws of {} chains are too few for the evidence: expected at least {} steps of each \
                 and {} draws",
                draws.len(),
                draws.chains,
                2 * FEWEST_STEPS,
                20 * (d + 1)
            ));
        }
        let free = Unconstrained::new(target);
        let half_of = |steps: std::ops::Range<usize>| {
            let places = (0..draws.chains).flat_map(|c| steps.clone().map(move |s| (c, s)));
            Matrix::from_rows(d, places.map(|(c, s)| free.free(draws.point(c, s))))
        };
        // Fit and estimate use different draws: a proposal fitted to the same draws would bias the estimate.
        let proposal = Normal::fit(&half_of(0..half))?;
        let (points, steps) = (half_of(half..draws.steps), draws.steps - half);
        let drawn = proposal.draw(points.rows(), stream);
        Ok(Self { free, proposal, points, drawn, steps })
    }

    /// Number of points at which the density is needed.
    pub fn count(&self) -> usize {
        self.points.rows() + self.drawn.rows()
    }

    /// Log densities of the target in unconstrained coordinates at some of the points.
    pub fn log_density(&self, points: std::ops::Range<usize>) -> Vec<f64> {
        let own = self.points.rows();
        let point = |i: usize| if i < own { self.points.row(i) } else { self.drawn.row(i - own) };
        self.free.log_density(&Matrix::from_rows(self.points.columns(), points.map(point)))
    }

    /// The evidence from the log density at each of the points.
    ///
    /// # Errors
    /// Reason why it cannot be estimated.
    pub fn evidence(&self, log_density: &[f64]) -> Result<Evidence, String> {
        let ratios = |points: &Matrix, density: &[f64]| -> Vec<f64> {
            let rows = density.iter().zip(points.iter_rows());
            rows.map(|(l, u)| l - self.proposal.log_density(u)).collect()
        };
        let (of_draws, of_proposal) = log_density.split_at(self.points.rows());
        let sides = Sides {
            of_draws: ratios(&self.points, of_draws),
            of_proposal: ratios(&self.drawn, of_proposal),
            share: share_of_draws(&self.points, self.steps),
        };
        if let Some(l) = sides.of_draws.iter().find(|l| !l.is_finite()) {
            return Err(format!(
                "a draw has the log density ratio {l}, which is impossible for a draw from the target"
            ));
        }
        let log = sides.solve()?;
        let error = sides.error(log, self.steps);
        if !error.is_finite() {
            return Err("the chains do not move, so that the evidence has no error".into());
        }
        let method = format!("bridge sampling: {} draws", self.points.rows());
        Ok(Evidence { log, error, method })
    }
}

/// A normal distribution in unconstrained coordinates.
struct Normal {
    mean: Vec<f64>,
    factor: Cholesky,
}

impl Normal {
    fn fit(points: &Matrix) -> Result<Self, String> {
        let moments = Moments::of_rows(points);
        let factor = Cholesky::new(&moments.covariance())
            .map_err(|_| "the draws do not span the space of the unknowns".to_owned())?;
        Ok(Self { mean: moments.mean().to_vec(), factor })
    }

    fn draw(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        let draw = |_| {
            let z: Vec<f64> = self.mean.iter().map(|_| normal(&mut rng)).collect();
            let offset = self.factor.colour(&z);
            offset.iter().zip(&self.mean).map(|(o, m)| o + m).collect::<Vec<f64>>()
        };
        Matrix::from_rows(self.mean.len(), (0..count).map(draw))
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        let offset: Vec<f64> = point.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        -0.5 * (self.factor.quadratic(&offset) + self.factor.log_determinant())
            - self.mean.len() as f64 * HALF_LN_TWO_PI
    }
}

/// Fraction of independent draws that come from the density, for equal numbers of draws from density and proposal.
fn share_of_draws(points: &Matrix, steps: usize) -> f64 {
    let worth = |j: usize| {
        let column = points.column(j);
        let values: Vec<Vec<f64>> = column.chunks(steps).map(<[f64]>::to_vec).collect();
        chains::ess_mean(&values)
    };
    let sizes: Vec<f64> = (0..points.columns()).map(worth).filter(|n| *n > 0.0).collect();
    let count = points.rows() as f64;
    // The median over the coordinates, as in Gronau et al.; a single slow coordinate hardly affects the optimal
    // weights.
    let size = if sizes.is_empty() { count } else { quantile(&sorted(&sizes), 0.5).min(count) };
    size / (size + count)
}

/// Log ratios of the unnormalised density to that of the proposal.
struct Sides {
    /// Log ratios at the draws from the density.
    of_draws: Vec<f64>,
    /// Log ratios at the draws from the proposal.
    of_proposal: Vec<f64>,
    /// Fraction of independent draws that come from the density.
    share: f64,
}

impl Sides {
    /// Fixed point of Meng and Wong's iteration for the optimal bridge function (Gronau et al., equation 15), as a
    /// logarithm.
    fn solve(&self) -> Result<f64, String> {
        let (s, rest) = (self.share, 1.0 - self.share);
        // Any reference that keeps the exponentials in range gives the same result.
        let reference = quantile(&sorted(&self.of_draws), 0.5);
        let mut r = 1.0;
        for _ in 0..ITERATIONS {
            let above =
                self.of_proposal.iter().map(|l| 1.0 / (s + rest * r * (reference - l).exp()));
            let below = self.of_draws.iter().map(|l| 1.0 / (s * (l - reference).exp() + rest * r));
            let ratio = (above.sum::<f64>() / self.of_proposal.len() as f64)
                / (below.sum::<f64>() / self.of_draws.len() as f64);
            if !(ratio > 0.0 && ratio.is_finite()) {
                return Err("the draws and the normal law fitted to them do not overlap".into());
            }
            if (ratio - r).abs() <= CONVERGED * ratio {
                return Ok(ratio.ln() + reference);
            }
            r = ratio;
        }
        Err(format!("bridge sampling did not converge in {ITERATIONS} iterations"))
    }

    /// Relative standard error of the evidence, which is the standard error of its logarithm.
    fn error(&self, log: f64, steps: usize) -> f64 {
        let (s, rest) = (self.share, 1.0 - self.share);
        let at_proposal: Vec<f64> =
            self.of_proposal.iter().map(|l| 1.0 / (s + rest * (log - l).exp())).collect();
        let at_draws: Vec<f64> =
            self.of_draws.iter().map(|l| 1.0 / (s * (l - log).exp() + rest)).collect();
        let of_proposal =
            variance(&at_proposal) / at_proposal.len() as f64 / mean(&at_proposal).powi(2);
        let series: Vec<Vec<f64>> = at_draws.chunks(steps).map(<[f64]>::to_vec).collect();
        // Walkers of one ensemble move together, which an error that assumes independent chains does not include.
        let together =
            if series.len() > 1 { autocorrelation::ensemble_error(&series) } else { 0.0 };
        let of_draws = chains::mcse_mean(&series).max(together) / mean(&at_draws);
        (of_proposal + of_draws * of_draws).sqrt()
    }
}

/// Log evidence by Laplace's approximation at a maximum of the log density.
///
/// The stated error is the size of the first correction: the mean ratio of the density to its normal approximation, by
/// the cubature rule of degree three (points at `sqrt(d)` standard deviations along the axes of the normal
/// distribution). It measures how far the density is from normal, and is not a bound of the error of the evidence.
pub fn laplace_evidence(target: &dyn Target, maximum: &[f64]) -> Result<Evidence, String> {
    let shape = laplace(target, maximum).map_err(|stop| stop.message)?;
    if !shape.definite {
        return Err("the density does not fall in all directions from the maximum".into());
    }
    let d = maximum.len();
    let factor = Cholesky::new(&shape.covariance)
        .map_err(|_| "the curvature at the maximum is not that of a maximum".to_owned())?;
    let reach = (d as f64).sqrt();
    let mut points = Matrix::zeros(0, d);
    points.push_row(maximum);
    for axis in 0..d {
        for side in [-reach, reach] {
            points.extend_row((0..d).map(|i| maximum[i] + side * shape.factor[(i, axis)]));
        }
    }
    let density = target.log_density(&points);
    let top = density[0];
    // At a distance of `sqrt(d)` standard deviations the normal density is `exp(-d / 2)` times its maximum.
    let ratios = density[1..].iter().map(|l| (l - top + 0.5 * d as f64).exp());
    let correction = (ratios.sum::<f64>() / (2 * d) as f64).ln();
    if !(top.is_finite() && correction.is_finite()) {
        return Err("the density vanishes around its maximum".into());
    }
    Ok(Evidence {
        log: top + d as f64 * HALF_LN_TWO_PI + 0.5 * factor.log_determinant(),
        // The curvature itself is accurate to about six digits.
        error: correction.abs().max(1e-6),
        method: "Laplace's approximation".into(),
    })
}

#[cfg(test)]
mod tests;

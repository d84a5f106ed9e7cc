//! Starting points of chains around a maximum.

use lacuna_base::math::Target;
use lacuna_base::math::moments::sorted;
use lacuna_base::math::random::{Stream, normal};
use lacuna_base::math::transform::Unconstrained;
use lacuna_base::run::Stop;
use lacuna_linalg::{Matrix, multiply_vector};

use crate::{Laplace, laplace, maximise};

/// Number of draws tried for each starting point.
const TRIES: u32 = 400;
/// Distance, in standard deviations, up to which a bound counts as near the maximum.
const NEAR: f64 = 2.0;
/// Number of bounds near the maximum from which on the normal distribution is that of the unconstrained density.
const CROWDED: usize = 2;
/// Factor by which starting points from the unconstrained density are more widely spread than its normal approximation:
/// R-hat is meaningful only for chains that start farther apart than the density is wide (Gelman and Rubin, Statist.
/// Sci. 7 (1992) 457).
const WIDER: f64 = 1.5;

/// Starting points around a maximum: draws of its normal approximation inside the support.
///
/// A draw outside the support, or with a log density lower than draws of a normal distribution ever have (more than
/// `10 + 4 sqrt(d / 2)` below its median), is repeated, closer to the maximum after every ten tries: a walker that
/// starts there might never reach the bulk. Coordinates on which the likelihood does not depend are drawn from their
/// priors: if many of them have their maximum at a bound, almost no draw of a normal distribution lies inside.
///
/// If two or more bounds are near, the normal approximation is that of the unconstrained density ([`Unconstrained`]):
/// all its draws are inside, for any number of bounds.
pub fn scatter(
    target: &dyn Target,
    maximum: &[f64],
    laplace: &Laplace,
    count: usize,
    stream: &Stream,
) -> Result<Matrix, Stop> {
    let idle = idle(target, maximum, &stream.named("idle"));
    let crowded = bounds_near(target, maximum, laplace, &idle) >= CROWDED;
    let bounded = || about(&Bounded { target, maximum, laplace }, target, &idle, count, stream);
    let free = || without_bounds(target, maximum, &idle, count, stream);
    let found = if crowded { free().or_else(bounded) } else { bounded().or_else(free) };
    found.ok_or_else(nowhere)
}

/// Like [`scatter`], but always with the normal approximation of the unconstrained density, for a maximum that has none
/// of its own.
pub fn scatter_without_bounds(
    target: &dyn Target,
    maximum: &[f64],
    count: usize,
    stream: &Stream,
) -> Result<Matrix, Stop> {
    let idle = idle(target, maximum, &stream.named("idle"));
    without_bounds(target, maximum, &idle, count, stream).ok_or_else(nowhere)
}

fn nowhere() -> Stop {
    Stop::new("no starting point near the best fit has a posterior density above zero")
        .help("start the chains at draws of the prior: `start = \"prior\"` in `[sampler]`")
}

/// Number of coordinates whose maximum is near a bound.
fn bounds_near(target: &dyn Target, maximum: &[f64], laplace: &Laplace, idle: &[usize]) -> usize {
    let near = |(j, (lo, hi)): (usize, (f64, f64))| {
        let reach = NEAR * laplace.covariance[(j, j)].sqrt();
        !idle.contains(&j) && (maximum[j] - lo <= reach || hi - maximum[j] <= reach)
    };
    target.bounds().into_iter().enumerate().filter(|bound| near(*bound)).count()
}

/// A normal distribution from which starting points are drawn.
trait Cloud {
    /// The point for a standard normal vector `z`, and its log density in the space of the normal distribution; `None`
    /// if it is outside the support.
    fn point(&self, z: &[f64]) -> Option<Vec<f64>>;
    /// Log density in the space of the points.
    fn log_density(&self, point: &[f64]) -> f64;
    /// Smallest log density that a starting point may have.
    fn lowest(&self) -> f64;
}

/// The requested number of points of a normal distribution; `None` if one of them is not found.
fn about(
    cloud: &dyn Cloud,
    target: &dyn Target,
    idle: &[usize],
    count: usize,
    stream: &Stream,
) -> Option<Matrix> {
    let dimension = target.dimension();
    let lowest = cloud.lowest();
    let mut points = Matrix::zeros(0, dimension);
    for index in 0..count {
        // One stream per point, so that a point does not depend on the number of tries for the points before it.
        let mut rng = stream.at(index as u64).generator();
        let found = (0..TRIES).find_map(|attempt| {
            // Draws contract after every ten failures: close enough to the maximum every point is acceptable.
            let shrink = 0.8_f64.powi((attempt / 10) as i32);
            let z: Vec<f64> = (0..dimension).map(|_| shrink * normal(&mut rng)).collect();
            let mut point = cloud.point(&z)?;
            if !idle.is_empty() {
                let tries = stream.named("idle").at(index as u64).at(u64::from(attempt));
                let draw = target.prior_draws(1, &tries);
                for &j in idle {
                    point[j] = draw[(0, j)];
                }
            }
            let inside =
                point.iter().zip(target.bounds()).all(|(x, (lo, hi))| *x >= lo && *x <= hi);
            (inside && cloud.log_density(&point) >= lowest).then_some(point)
        });
        points.push_row(&found?);
    }
    Some(points)
}

fn density(target: &dyn Target, point: &[f64]) -> f64 {
    target.log_density(&Matrix::from_rows(point.len(), [point]))[0]
}

/// The normal approximation of a density within its bounds.
struct Bounded<'a> {
    target: &'a dyn Target,
    maximum: &'a [f64],
    laplace: &'a Laplace,
}

impl Cloud for Bounded<'_> {
    fn point(&self, z: &[f64]) -> Option<Vec<f64>> {
        let offset = multiply_vector(&self.laplace.factor, z);
        Some(self.maximum.iter().zip(offset).map(|(x, o)| x + o).collect())
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        density(self.target, point)
    }

    fn lowest(&self) -> f64 {
        let half = 0.5 * self.maximum.len() as f64;
        density(self.target, self.maximum) - half - 10.0 - 4.0 * half.sqrt()
    }
}

/// The normal approximation of the unconstrained density.
struct Free<'a> {
    space: &'a Unconstrained<'a>,
    top: Vec<f64>,
    value: f64,
    laplace: Laplace,
}

impl Cloud for Free<'_> {
    fn point(&self, z: &[f64]) -> Option<Vec<f64>> {
        let offset = multiply_vector(&self.laplace.factor, z);
        let u: Vec<f64> = self.top.iter().zip(offset).map(|(u, o)| u + WIDER * o).collect();
        u.iter().all(|u| u.is_finite()).then(|| self.space.bounded(&u))
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        density(self.space, &self.space.free(point))
    }

    fn lowest(&self) -> f64 {
        let half = 0.5 * self.top.len() as f64;
        self.value - 10.0 - WIDER * WIDER * (half + 4.0 * half.sqrt())
    }
}

fn without_bounds(
    target: &dyn Target,
    maximum: &[f64],
    idle: &[usize],
    count: usize,
    stream: &Stream,
) -> Option<Matrix> {
    let free = Unconstrained::new(target);
    let start = free.free(&inside(target, maximum)?);
    let top = maximise(&free, &Matrix::from_rows(start.len(), [&start])).into_iter().next()?;
    let laplace = laplace(&free, &top.point).ok()?;
    let cloud = Free { space: &free, top: top.point, value: top.value, laplace };
    about(&cloud, target, idle, count, stream)
}

/// A point next to a maximum that is on no bound: displaced inwards until the density has fallen by a factor of e,
/// according to its slope.
fn inside(target: &dyn Target, maximum: &[f64]) -> Option<Vec<f64>> {
    const HALVINGS: i32 = 100;
    let (_, gradient) = target.gradient(maximum);
    let bounds = target.bounds();
    // Any fixed stream serves: the draws only give the order of magnitude.
    let draws = target.prior_draws(65, &Stream::root(0).named("inside"));
    let usual = |j: usize| {
        let away = draws.column(j).into_iter().map(|x| (x - maximum[j]).abs());
        let away = sorted(&away.collect::<Vec<_>>())[32];
        if away > 0.0 && away.is_finite() { away } else { maximum[j].abs().max(1.0) }
    };
    let moved = |share: f64| {
        let place = |(j, &x): (usize, &f64)| {
            let (lo, hi) = bounds[j];
            let fall = if gradient[j] == 0.0 { f64::INFINITY } else { 1.0 / gradient[j].abs() };
            let room = if (hi - lo).is_finite() { 0.25 * (hi - lo) } else { usual(j) };
            let step = share * fall.min(room);
            x.max(lo + step.min(room)).min(hi - step.min(room))
        };
        let on_bound = |j: usize| maximum[j] <= bounds[j].0 || maximum[j] >= bounds[j].1;
        let each = maximum.iter().enumerate();
        each.map(|(j, x)| if on_bound(j) { place((j, x)) } else { *x }).collect::<Vec<f64>>()
    };
    let tried = (0..HALVINGS).map(|k| moved(0.5_f64.powi(k)));
    tried.into_iter().find(|point| density(target, point).is_finite())
}

/// The coordinates on which the likelihood at a point does not depend: it is equal at draws from their priors.
fn idle(target: &dyn Target, point: &[f64], stream: &Stream) -> Vec<usize> {
    const DRAWS: usize = 2;
    let d = point.len();
    let draws = target.prior_draws(DRAWS, stream);
    let mut moved = Matrix::from_rows(d, std::iter::repeat_n(point, 1 + d * DRAWS));
    for (j, k) in (0..d).flat_map(|j| (0..DRAWS).map(move |k| (j, k))) {
        moved[(1 + j * DRAWS + k, j)] = draws[(k, j)];
    }
    let (density, prior) = (target.log_density(&moved), target.log_prior(&moved));
    let likelihood = |i: usize| density[i] - prior[i];
    // Density less prior cancels: differences below the rounding of both terms do not count as a dependence.
    let rounding = |i: usize| 1e-12 * (density[i].abs() + prior[i].abs() + density[0].abs());
    let same = |i: usize| (likelihood(i) - likelihood(0)).abs() <= rounding(i);
    (0..d).filter(|j| (0..DRAWS).all(|k| same(1 + j * DRAWS + k))).collect()
}

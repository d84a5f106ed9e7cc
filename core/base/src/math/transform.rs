//! Change of variables from a bounded log density to one on all of space.
//!
//! A coordinate with two bounds is replaced by its logit, one with a single bound by the logarithm of its distance from
//! it, an unbounded one is kept. The density includes the Jacobian, so that draws of it map back to draws of the
//! original (Carpenter et al., J. Stat. Softw. 76 (2017), section 10 of the Stan reference manual).

use crate::math::Target;
use crate::math::random::Stream;
use crate::matrix::Matrix;

/// A target on all of `R^d` whose draws map to draws of the wrapped target.
pub struct Unconstrained<'a> {
    target: &'a dyn Target,
    maps: Vec<Map>,
}

impl<'a> Unconstrained<'a> {
    /// Wraps a target according to its bounds.
    pub fn new(target: &'a dyn Target) -> Self {
        Self { target, maps: target.bounds().into_iter().map(Map::of).collect() }
    }

    /// Maps a free point to the wrapped target; the result is always strictly inside the bounds.
    pub fn bounded(&self, free: &[f64]) -> Vec<f64> {
        self.maps.iter().zip(free).map(|(map, &u)| map.bounded(u)).collect()
    }

    /// Maps a point of the wrapped target to free coordinates. A coordinate on its bound has no image and is first
    /// moved inside by the smallest distance that rounding resolves.
    pub fn free(&self, bounded: &[f64]) -> Vec<f64> {
        self.maps.iter().zip(bounded).map(|(map, &x)| map.free(x)).collect()
    }

    fn all_bounded(&self, free: &Matrix) -> Matrix {
        Matrix::from_rows(self.maps.len(), free.iter_rows().map(|u| self.bounded(u)))
    }

    fn log_jacobian(&self, free: &[f64]) -> f64 {
        self.maps.iter().zip(free).map(|(map, &u)| map.log_slope(u)).sum()
    }

    /// Densities of the wrapped target converted to densities of the free points.
    fn carry(&self, free: &Matrix, densities: Vec<f64>) -> Vec<f64> {
        let pairs = densities.into_iter().zip(free.iter_rows());
        pairs.map(|(value, u)| usable(value + self.log_jacobian(u))).collect()
    }
}

/// Replaces NaN and plus infinity by minus infinity.
fn usable(density: f64) -> f64 {
    if density.is_finite() { density } else { f64::NEG_INFINITY }
}

impl Target for Unconstrained<'_> {
    fn dimension(&self) -> usize {
        self.maps.len()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.carry(points, self.target.log_density(&self.all_bounded(points)))
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        self.carry(points, self.target.log_prior(&self.all_bounded(points)))
    }

    /// Log density and gradient; minus infinity and zeros if the density or its slope is undefined.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (value, slopes) = self.target.gradient(&self.bounded(point));
        let value = usable(value + self.log_jacobian(point));
        let slopes = self.maps.iter().zip(point).zip(slopes);
        let gradient: Vec<f64> = slopes
            .map(|((map, &u), slope)| slope * map.slope(u) + map.log_slope_slope(u))
            .collect();
        if value.is_finite() && gradient.iter().all(|g| g.is_finite()) {
            (value, gradient)
        } else {
            (f64::NEG_INFINITY, vec![0.0; point.len()])
        }
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); self.maps.len()]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let draws = self.target.prior_draws(count, stream);
        Matrix::from_rows(self.maps.len(), draws.iter_rows().map(|x| self.free(x)))
    }
}

/// Map from a free coordinate `u` to a coordinate `x` within its bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Map {
    /// `x = u`.
    Free,
    /// `x = lo + exp(u)`.
    Above(f64),
    /// `x = hi - exp(u)`.
    Below(f64),
    /// `x = lo + (hi - lo) / (1 + exp(-u))`.
    Between(f64, f64),
}

impl Map {
    fn of((lo, hi): (f64, f64)) -> Self {
        match (lo.is_finite(), hi.is_finite()) {
            (false, false) => Self::Free,
            (true, false) => Self::Above(lo),
            (false, true) => Self::Below(hi),
            (true, true) => Self::Between(lo, hi),
        }
    }

    fn bounded(self, u: f64) -> f64 {
        match self {
            Self::Free => u,
            Self::Above(lo) => (lo + u.exp()).clamp(lo.next_up(), f64::MAX),
            Self::Below(hi) => (hi - u.exp()).clamp(f64::MIN, hi.next_down()),
            Self::Between(lo, hi) => {
                // Computed from the nearer bound, where f64 resolves the distance best.
                let x = if u < 0.0 {
                    lo + (hi - lo) * logistic(u)
                } else {
                    hi - (hi - lo) * logistic(-u)
                };
                x.max(lo.next_up()).min(hi.next_down())
            }
        }
    }

    fn free(self, x: f64) -> f64 {
        match self {
            Self::Free => x,
            Self::Above(lo) => (x - lo).max(margin(lo)).ln(),
            Self::Below(hi) => (hi - x).max(margin(hi)).ln(),
            Self::Between(lo, hi) => {
                let inside = |distance: f64| {
                    if distance > 0.0 { distance } else { f64::EPSILON * (hi - lo) }
                };
                inside(x - lo).ln() - inside(hi - x).ln()
            }
        }
    }

    /// `ln |dx/du|`.
    fn log_slope(self, u: f64) -> f64 {
        match self {
            Self::Free => 0.0,
            Self::Above(_) | Self::Below(_) => u,
            Self::Between(lo, hi) => (hi - lo).ln() - u.abs() - 2.0 * (-u.abs()).exp().ln_1p(),
        }
    }

    /// `dx/du`.
    fn slope(self, u: f64) -> f64 {
        match self {
            Self::Free => 1.0,
            Self::Above(_) => u.exp(),
            Self::Below(_) => -u.exp(),
            Self::Between(lo, hi) => (hi - lo) * logistic(u) * logistic(-u),
        }
    }

    /// `d ln |dx/du| / du`.
    fn log_slope_slope(self, u: f64) -> f64 {
        match self {
            Self::Free => 0.0,
            Self::Above(_) | Self::Below(_) => 1.0,
            Self::Between(..) => -(0.5 * u).tanh(),
        }
    }
}

/// `1 / (1 + exp(-u))`, accurate for large negative `u`.
fn logistic(u: f64) -> f64 {
    if u < 0.0 {
        let e = u.exp();
        e / (1.0 + e)
    } else {
        1.0 / (1.0 + (-u).exp())
    }
}

/// Smallest distance from a bound that survives rounding.
fn margin(bound: f64) -> f64 {
    (f64::EPSILON * bound.abs()).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::distribution::Distribution;

    /// Independent distributions, one per coordinate.
    struct Laws(Vec<Distribution>);

    impl Target for Laws {
        fn dimension(&self) -> usize {
            self.0.len()
        }
        fn log_density(&self, points: &Matrix) -> Vec<f64> {
            points
                .iter_rows()
                .map(|x| self.0.iter().zip(x).map(|(law, &x)| law.log_density(x)).sum())
                .collect()
        }
        fn log_prior(&self, points: &Matrix) -> Vec<f64> {
            self.log_density(points)
        }
        fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
            let slopes = self.0.iter().zip(x).map(|(law, &x)| law.log_density_derivative(x));
            (self.log_density(&Matrix::from_rows(x.len(), [x]))[0], slopes.collect())
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            self.0.iter().map(Distribution::support).collect()
        }
        fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
            let mut rng = stream.generator();
            Matrix::from_fn(count, self.0.len(), |_, j| self.0[j].sample(&mut rng))
        }
    }

    fn density(free: &Unconstrained<'_>, u: f64) -> f64 {
        free.log_density(&Matrix::from_rows(1, [[u]]))[0]
    }

    #[test]
    fn a_uniform_law_becomes_logistic_and_an_exponential_one_gumbel() {
        // Closed forms: exp(-u) / (1 + exp(-u))^2, and exp(u - exp(u)) for rate one.
        let uniform = Laws(vec![Distribution::Uniform([-3.0, 5e5])]);
        let exponential = Laws(vec![Distribution::Exponential(1.0)]);
        for u in [-30.0_f64, -3.0, 0.0, 0.7, 12.0] {
            let found = density(&Unconstrained::new(&uniform), u);
            assert!((found - (-u - 2.0 * (-u).exp().ln_1p())).abs() < 1e-12, "{u}: {found}");
            let found = density(&Unconstrained::new(&exponential), u);
            assert!((found - (u - u.exp())).abs() < 1e-9 * u.exp().max(1.0), "{u}: {found}");
        }
    }

    fn mixed() -> Laws {
        Laws(vec![
            Distribution::Normal([3.0, 1e4]),
            Distribution::Gamma([2.5, 1e5]),
            Distribution::Uniform([1e4, 2e4]),
            Distribution::Beta([2.0, 3.0, 0.0, 1.0]),
        ])
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_density() {
        let laws = mixed();
        let free = Unconstrained::new(&laws);
        let u = [2.0, 11.0, -1.3, 0.4];
        let (value, gradient) = free.gradient(&u);
        assert_eq!(value, free.log_density(&Matrix::from_rows(4, [u]))[0]);
        for j in 0..4 {
            let at = |h: f64| {
                let mut moved = u;
                moved[j] += h;
                free.gradient(&moved).0
            };
            let slope = (at(1e-4) - at(-1e-4)) / 2e-4;
            assert!((slope - gradient[j]).abs() < 1e-6, "{j}: {slope} and {}", gradient[j]);
        }
    }

    #[test]
    fn the_density_still_integrates_to_one() {
        for law in mixed().0 {
            let scale = if law.support().0.is_finite() { 1.0 } else { 1e4 };
            let laws = Laws(vec![law]);
            let free = Unconstrained::new(&laws);
            // The trapezoidal rule converges geometrically for densities that vanish at both ends.
            let step = 0.02 * scale;
            let sum: f64 = (-2000..=2000).map(|i| density(&free, f64::from(i) * step).exp()).sum();
            assert!((sum * step - 1.0).abs() < 1e-9, "{:?}: {}", laws.0, sum * step);
        }
    }

    #[test]
    fn points_go_there_and_back() {
        let laws = mixed();
        let free = Unconstrained::new(&laws);
        for x in [[0.5, 2e5, 1.5e4, 0.3], [-1e5, 1e-9, 1.000_001e4, 1e-20]] {
            for (back, x) in free.bounded(&free.free(&x)).iter().zip(x) {
                assert!((back - x).abs() <= 1e-11 * x.abs(), "{back} and {x}");
            }
        }
        let draws = free.prior_draws(50, &Stream::root(1));
        let first = free.bounded(draws.row(0));
        let expected = laws.prior_draws(50, &Stream::root(1));
        for (a, b) in first.iter().zip(expected.row(0)) {
            assert!((a - b).abs() < 1e-9 * b.abs());
        }
    }

    #[test]
    fn edges_have_finite_places_inside() {
        let laws = Laws(vec![
            Distribution::Uniform([0.0, 1.0]),
            Distribution::Exponential(2.0),
            Distribution::Uniform([1e4, 1.000_000_001e4]),
        ]);
        let free = Unconstrained::new(&laws);
        for x in [[0.0, 0.0, 1e4], [1.0, 1e300, 1.000_000_001e4]] {
            let u = free.free(&x);
            assert!(u.iter().all(|u| u.is_finite()), "{u:?}");
            let back = free.bounded(&u);
            let inside =
                back.iter().zip(free.target.bounds()).all(|(x, (lo, hi))| *x > lo && *x < hi);
            assert!(inside, "{back:?}");
        }
        for u in [-1e300, -800.0, 800.0, 1e300] {
            let (value, gradient) = free.gradient(&[u; 3]);
            assert!(!value.is_nan() && gradient.iter().all(|g| g.is_finite()), "{u}");
            assert!(free.bounded(&[u; 3]).iter().all(|x| x.is_finite()));
        }
    }
}

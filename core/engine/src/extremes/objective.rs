//! A function of the unit cube as what the optimiser of log densities climbs.

use std::sync::Mutex;

use lacuna::math::Target;
use lacuna::math::random::Stream;
use lacuna_linalg::Matrix;

use super::Towards;
use super::pool::Pool;

/// Step of the differences. Quantiles of finitely many draws have kinks, so that the step is far above rounding; at an
/// optimum inside the cube its error shifts the point by the order of its square.
const STEP: f64 = 0.01;

/// A function divided by its range, largest where the search goes.
pub(super) struct Objective<'a, 'b, 'c> {
    /// The points of the search.
    pub pool: &'a Mutex<&'b mut Pool<'c>>,
    /// Number of the function.
    pub function: usize,
    /// Direction of the search.
    pub towards: Towards,
    /// Value that becomes zero.
    pub origin: f64,
    /// Difference that becomes one.
    pub range: f64,
}

impl Objective<'_, '_, '_> {
    fn scaled(&self, value: f64) -> f64 {
        self.towards.signed((value - self.origin) / self.range)
    }

    /// Values at points; `None` if there is no room for them.
    fn at(&self, points: &[Vec<f64>]) -> Option<Vec<f64>> {
        let mut pool = self.pool.lock().ok()?;
        let rows = pool.at(points)?;
        Some(rows.iter().map(|&row| self.scaled(pool.values[row][self.function])).collect())
    }
}

/// The point and its neighbours below and above in each coordinate, inside the cube.
fn stencil(point: &[f64]) -> Vec<Vec<f64>> {
    let mut all = vec![point.to_vec()];
    for j in 0..point.len() {
        for step in [-STEP, STEP] {
            let mut moved = point.to_vec();
            moved[j] = (point[j] + step).clamp(0.0, 1.0);
            all.push(moved);
        }
    }
    all
}

/// Slope between the neighbours of a point, of which one may be undefined; zero if both are.
fn slope([below, here, above]: [(f64, f64); 3]) -> f64 {
    let between =
        |(a, f): (f64, f64), (b, g): (f64, f64)| if b > a { (g - f) / (b - a) } else { 0.0 };
    match (below.1.is_finite(), above.1.is_finite()) {
        (true, true) => between(below, above),
        (true, false) => between(below, here),
        (false, true) => between(here, above),
        (false, false) => 0.0,
    }
}

impl Target for Objective<'_, '_, '_> {
    fn dimension(&self) -> usize {
        self.pool.lock().map_or(0, |pool| pool.points.first().map_or(0, Vec::len))
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let all: Vec<Vec<f64>> = points.iter_rows().map(<[f64]>::to_vec).collect();
        let finite = |value: f64| if value.is_nan() { f64::NEG_INFINITY } else { value };
        let found = self.at(&all).unwrap_or_else(|| vec![f64::NEG_INFINITY; all.len()]);
        found.into_iter().map(finite).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let points = stencil(point);
        let nothing = (f64::NEG_INFINITY, vec![0.0; point.len()]);
        let Some(values) = self.at(&points).filter(|values| values[0].is_finite()) else {
            return nothing;
        };
        let along = |j: usize| {
            let at = |k: usize| (points[k][j], values[k]);
            slope([at(1 + 2 * j), at(0), at(2 + 2 * j)])
        };
        (values[0], (0..point.len()).map(along).collect())
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(0.0, 1.0); self.dimension()]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut generator = stream.generator();
        Matrix::from_fn(count, self.dimension(), |_, _| {
            lacuna::math::random::uniform(&mut generator)
        })
    }
}

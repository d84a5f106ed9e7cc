//! A look at the derivatives of the log density before they are used: a gradient with a wrong sign gives a best fit that is
//! none, and says nothing.

use lacuna::math::moments::variance;
use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;

use super::Coordinate;

/// Draws of the prior among which points with a density are sought, and the number of such points.
const DRAWS: usize = 20;
const POINTS: usize = 2;
/// Step of the differences, as a part of the scatter of the prior.
const STEP: f64 = 1e-4;
/// Largest difference that is no contradiction, as a part of the derivative.
const TOLERANCE: f64 = 0.1;

/// Contradiction of the gradient of a density, in words: by differences along each coordinate at two draws of the prior, of
/// two steps, so that their own error is known. `None` if there is none, or the density cannot be evaluated there. Each
/// coordinate is compared by itself, because the largest derivative hides the others along any direction of all.
pub(super) fn contradiction(
    target: &dyn Target,
    coordinates: &[Coordinate],
    stream: &Stream,
) -> Option<String> {
    let draws = target.prior_draws(DRAWS, stream);
    let density = target.log_density(&draws);
    let scales: Vec<f64> =
        (0..draws.columns()).map(|j| variance(&draws.column(j)).sqrt()).collect();
    let points: Vec<&[f64]> = (0..draws.rows())
        .filter(|&i| density[i].is_finite())
        .map(|i| draws.row(i))
        .take(POINTS)
        .collect();
    if points.len() < POINTS {
        return None;
    }
    let gradients: Vec<Vec<f64>> = points.iter().map(|point| target.gradient(point).1).collect();
    let along = |j: usize| -> Option<(usize, Compared)> {
        let compared = points.iter().zip(&gradients);
        let all: Option<Vec<Compared>> = compared
            .map(|(point, gradient)| Compared::of(target, point, gradient, (j, scales[j])))
            .collect();
        let all = all.filter(|all| all.iter().all(Compared::contradicts))?;
        Some((j, all.into_iter().next()?))
    };
    let worst =
        (0..scales.len()).filter_map(along).max_by(|a, b| a.1.gap().total_cmp(&b.1.gap()))?;
    let (j, Compared { given, found, .. }) = worst;
    let name = &coordinates[j].name;
    Some(format!(
        "a derivative of the log density is wrong: by `{name}`, per standard deviation of its prior, it is {given:.4e} where \
         differences of the density give {found:.4e}; the gradient of the model, the discrepancy or an effect does not \
         belong to its values, so that the best fit may be none (`lacuna plugins test FILE` tests a plugin)"
    ))
}

/// A derivative by a coordinate per standard deviation of its prior, as it is given and as differences give it.
struct Compared {
    given: f64,
    found: f64,
    /// Error of the differences.
    error: f64,
}

impl Compared {
    /// `None` where the density has no number on one of the sides.
    fn of(
        target: &dyn Target,
        point: &[f64],
        gradient: &[f64],
        (j, scale): (usize, f64),
    ) -> Option<Self> {
        let rows = [STEP, -STEP, 0.5 * STEP, -0.5 * STEP].map(|step| {
            let mut moved = point.to_vec();
            moved[j] += step * scale;
            moved
        });
        let values = target.log_density(&Matrix::from_rows(point.len(), rows));
        if values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let wide = (values[0] - values[1]) / (2.0 * STEP);
        let found = (values[2] - values[3]) / STEP;
        let rounding = f64::EPSILON * values.iter().fold(0.0_f64, |m, v| m.max(v.abs())) / STEP;
        let error = (wide - found).abs() + 100.0 * rounding;
        Some(Self { given: gradient[j] * scale, found, error })
    }

    fn gap(&self) -> f64 {
        (self.given - self.found).abs()
    }

    fn contradicts(&self) -> bool {
        let size = self.given.abs().max(self.found.abs());
        self.gap() > TOLERANCE * size + 10.0 * self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A normal density in two unknowns, whose gradient has the factor `by` in its second part.
    struct Normal {
        by: f64,
    }

    impl Target for Normal {
        fn dimension(&self) -> usize {
            2
        }
        fn log_density(&self, points: &Matrix) -> Vec<f64> {
            points.iter_rows().map(|p| -0.5 * (p[0].powi(2) + (p[1] / 1e-3).powi(2))).collect()
        }
        fn log_prior(&self, points: &Matrix) -> Vec<f64> {
            vec![0.0; points.rows()]
        }
        fn gradient(&self, p: &[f64]) -> (f64, Vec<f64>) {
            let value = self.log_density(&Matrix::from_rows(2, [p]))[0];
            (value, vec![-p[0], -self.by * p[1] / 1e-6])
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            vec![(f64::NEG_INFINITY, f64::INFINITY); 2]
        }
        fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
            let mut rng = stream.generator();
            Matrix::from_fn(count, 2, |_, j| {
                lacuna::math::random::normal(&mut rng) * [1.0, 1e-3][j]
            })
        }
    }

    fn found(by: f64, seed: u64) -> Option<String> {
        let coordinate = |name: &str| Coordinate {
            name: name.to_owned(),
            symbol: name.to_owned(),
            unit: lacuna::data::Unit::dimensionless(),
            prior: None,
            reference: None,
        };
        let coordinates = ["a", "b"].map(coordinate);
        contradiction(&Normal { by }, &coordinates, &Stream::root(seed))
    }

    #[test]
    fn a_wrong_derivative_is_told_with_its_coordinate() {
        for seed in 0..20 {
            assert_eq!(found(1.0, seed), None);
        }
        let said = found(-1.0, 1).unwrap_or_default();
        assert!(said.contains("by `b`"), "{said}");
        assert!(found(0.0, 1).is_some());
    }
}

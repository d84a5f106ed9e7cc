//! `skeleton`: a polynomial by least squares.

use lacuna::data::Parameter;
use lacuna::math::moments::{mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::plugin::{Component, Context, Emulator, Fact, Forward, Surrogate};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A full polynomial in all parameters, fitted by least squares (a response surface).
///
/// Suitable for smooth responses of few parameters. It needs more runs than it has terms, which are many:
/// `polynomial_chaos` selects among them.
///
/// Reference: Box and Draper, Empirical Model-Building and Response Surfaces (1987); leave-one-out errors from the hat
/// matrix: Allen, Technometrics 16 (1974) 125.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Total degree of the polynomial: 2 includes squares and products of two parameters.
    pub degree: usize,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { degree: 3 }
    }
}

/// Number of monomials up to a total degree, `(dimension + degree)! / (dimension! degree!)`, as a float because it may
/// be large.
fn count(dimension: usize, degree: usize) -> f64 {
    (1..=degree).fold(1.0, |terms, k| terms * (dimension + k) as f64 / k as f64)
}

impl Component for Skeleton {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.degree == 0 {
            let spot = complaints.at("degree");
            spot.say("a constant does not depend on parameters").expected("at least 1").found(0);
        }
        let terms = count(context.parameters.len(), self.degree);
        if let Some(runs) = context.runs.filter(|runs| *runs as f64 <= terms) {
            complaints
                .at("degree")
                .say("too many terms for the runs of the design")
                .expected(format!("fewer than {runs} terms"))
                .found(format!("{terms} terms of degree {}", self.degree))
                .help("choose a lower degree, or more runs");
        }
    }
}

impl Surrogate for Skeleton {
    fn fit(
        &self,
        training: &Training<'_>,
        _stream: &Stream,
        _progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        let (points, responses) = (training.points, training.responses);
        let (runs, terms) = (points.rows(), count(points.columns(), self.degree));
        if responses.rows() != runs {
            return Err(Stop::new(format!("{runs} runs have {} responses", responses.rows())));
        }
        if runs as f64 <= terms {
            let text = format!("{runs} runs are too few for the {terms} terms of the polynomial");
            return Err(Stop::new(text).help("choose a lower `degree`, or more runs"));
        }
        if points.as_slice().iter().chain(responses.as_slice()).any(|x| !x.is_finite()) {
            return Err(Stop::new("a run has a value that is not finite"));
        }
        Ok(Box::new(Polynomial::fit(self.degree, training.parameters, points, responses)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        let read: Polynomial = serde_json::from_slice(bytes)
            .map_err(|error| Stop::new(format!("these bytes are no polynomial: {error}")))?;
        if read.is_sound() {
            Ok(Box::new(read))
        } else {
            Err(Stop::new("the numbers of a polynomial do not fit together"))
        }
    }
}

/// A fitted polynomial in coordinates scaled to -1..1 over the runs.
#[derive(Debug, Serialize, Deserialize)]
struct Polynomial {
    centre: Vec<f64>,
    half: Vec<f64>,
    /// Exponents of each term.
    exponents: Vec<Vec<i32>>,
    coefficients: Matrix,
    error: FitError,
}

/// Exponents of all monomials up to total degree `degree`.
fn exponents(dimension: usize, degree: usize) -> Vec<Vec<i32>> {
    if dimension == 0 {
        return vec![Vec::new()];
    }
    let with_first = |first: usize| {
        let rest = exponents(dimension - 1, degree - first).into_iter();
        rest.map(move |rest| [vec![first as i32], rest].concat())
    };
    (0..=degree).flat_map(with_first).collect()
}

impl Polynomial {
    fn fit(
        degree: usize,
        parameters: &[Parameter],
        points: &Matrix,
        responses: &Matrix,
    ) -> Result<Self, Stop> {
        let range = |j: usize| {
            let column = points.column(j);
            let low = column.iter().copied().fold(f64::INFINITY, f64::min);
            (low, column.iter().copied().fold(f64::NEG_INFINITY, f64::max))
        };
        let ranges: Vec<(f64, f64)> = (0..points.columns()).map(range).collect();
        let same = ranges.iter().zip(parameters).find(|((low, high), _)| low == high);
        if let Some((_, parameter)) = same {
            return Err(Stop::new(format!("all runs have the same `{}`", parameter.name)));
        }
        let mut made = Self {
            centre: ranges.iter().map(|(low, high)| 0.5 * (low + high)).collect(),
            half: ranges.iter().map(|(low, high)| 0.5 * (high - low)).collect(),
            exponents: exponents(points.columns(), degree),
            coefficients: Matrix::default(),
            error: FitError::default(),
        };
        let fault = |error| Stop::new(format!("the polynomial cannot be fitted: {error}"));
        let basis = made.basis(points);
        let qr = lacuna_linalg::thin_qr(&basis).map_err(fault)?;
        let pivots = (0..qr.r.columns()).map(|k| qr.r[(k, k)].abs());
        let [least, most] = [f64::min, f64::max]
            .map(|choose: fn(f64, f64) -> f64| pivots.clone().reduce(choose).unwrap_or(0.0));
        if least <= 1e-12 * most {
            let text = "the runs do not tell all terms of the polynomial apart";
            return Err(Stop::new(text).help("choose a lower `degree`, or another design"));
        }
        let mut coefficients = lacuna_linalg::transposed_multiply(&qr.q, responses);
        lacuna_linalg::solve_upper_matrix(&qr.r, &mut coefficients);
        made.error = left_out(&qr.q, responses, &lacuna_linalg::multiply(&basis, &coefficients))?;
        made.coefficients = coefficients;
        Ok(made)
    }

    /// Returns true if bytes that were read are a valid polynomial.
    fn is_sound(&self) -> bool {
        let whole = |m: &Matrix| m.rows().checked_mul(m.columns()) == Some(m.as_slice().len());
        let dimension = self.centre.len();
        self.half.len() == dimension
            && self.exponents.iter().all(|powers| powers.len() == dimension)
            && whole(&self.coefficients)
            && whole(&self.error.residuals)
            && self.coefficients.rows() == self.exponents.len()
            && self.error.relative.len() == self.coefficients.columns()
    }

    fn scaled(&self, point: &[f64]) -> Vec<f64> {
        let sides = self.centre.iter().zip(&self.half);
        point.iter().zip(sides).map(|(x, (centre, half))| (x - centre) / half).collect()
    }
}

/// Residual that each run would have in a fit without it: `residual / (1 - h)`, with `h` the diagonal of the hat matrix
/// `Q Q'`.
fn left_out(q: &Matrix, responses: &Matrix, fitted: &Matrix) -> Result<FitError, Stop> {
    let leverage: Vec<f64> =
        q.iter_rows().map(|row| row.iter().map(|x| x * x).sum::<f64>()).collect();
    if let Some(run) = leverage.iter().position(|h| 1.0 - h < 1e-10) {
        let text = format!("run {} decides a term of the polynomial alone", run + 1);
        return Err(Stop::new(text).help("choose a lower `degree`, or more runs"));
    }
    let residuals = Matrix::from_fn(responses.rows(), responses.columns(), |i, j| {
        (responses[(i, j)] - fitted[(i, j)]) / (1.0 - leverage[i])
    });
    let relative = |j: usize| {
        let squares: Vec<f64> = residuals.column(j).iter().map(|e| e * e).collect();
        let spread = variance(&responses.column(j));
        if spread > 0.0 { mean(&squares) / spread } else { 0.0 }
    };
    Ok(FitError { relative: (0..responses.columns()).map(relative).collect(), residuals })
}

impl Forward for Polynomial {
    fn dimension(&self) -> usize {
        self.centre.len()
    }

    fn outputs(&self) -> usize {
        self.coefficients.columns()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        lacuna_linalg::multiply(&self.basis(points), &self.coefficients)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        lacuna_linalg::transposed_multiply(&self.coefficients, &self.basis_gradient(point))
    }

    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }
}

impl Linear for Polynomial {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let terms = |point: &[f64]| -> Vec<f64> {
            let u = self.scaled(point);
            let term = |powers: &Vec<i32>| powers.iter().zip(&u).map(|(n, u)| u.powi(*n)).product();
            self.exponents.iter().map(term).collect()
        };
        Matrix::from_rows(self.exponents.len(), points.iter_rows().map(terms))
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let u = self.scaled(point);
        Matrix::from_fn(self.exponents.len(), u.len(), |t, j| {
            let factor = |(k, n): (usize, &i32)| match (k == j, *n) {
                (false, n) => u[k].powi(n),
                (true, 0) => 0.0,
                (true, n) => f64::from(n) * u[k].powi(n - 1) / self.half[k],
            };
            self.exponents[t].iter().enumerate().map(factor).product()
        })
    }
}

impl Emulator for Polynomial {
    fn fit_error(&self) -> &FitError {
        &self.error
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("terms", self.exponents.len())]
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        serde_json::to_vec(self)
            .map_err(|error| Stop::new(format!("the polynomial cannot be saved: {error}")))
    }
}

lacuna::register!(Surrogate, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::Layout;
    use lacuna::math::distribution::Distribution;
    use lacuna::math::random::uniform;
    use lacuna::run::Silent;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::surrogate("skeleton", &Skeleton::default()), Ok(()));
    }

    fn fitted(points: &Matrix, responses: &Matrix) -> Box<dyn Emulator> {
        let parameters =
            ["a", "b"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 1.0])));
        let layouts = Layout::number("y").into();
        let training = Training {
            parameters: &parameters,
            layouts: &layouts,
            points,
            responses,
            gradients: None,
        };
        let (stream, progress) = (Stream::root(1), Progress::new(&Silent));
        Skeleton { degree: 2 }.fit(&training, &stream, &progress).unwrap()
    }

    fn runs(truth: impl Fn(&[f64]) -> f64) -> (Matrix, Matrix) {
        let mut rng = Stream::root(2).generator();
        let points = Matrix::from_fn(12, 2, |_, _| uniform(&mut rng));
        let responses = points.iter_rows().map(truth).collect();
        (points, Matrix::from_vec(12, 1, responses))
    }

    #[test]
    fn a_polynomial_of_its_degree_is_met() {
        let truth = |x: &[f64]| 3.0 - x[0] + 2.0 * x[0] * x[1] + 5.0 * x[1] * x[1];
        let (points, responses) = runs(truth);
        let emulator = fitted(&points, &responses);
        let found = emulator.mean(&Matrix::from_vec(1, 2, vec![2.0, -1.0]))[(0, 0)];
        assert!((found - truth(&[2.0, -1.0])).abs() < 1e-10, "{found}");
        assert!(emulator.fit_error().relative[0] < 1e-24);
    }

    #[test]
    fn leave_one_out_residuals_are_those_of_fits_without_the_run() {
        let (points, responses) = runs(|x| (3.0 * x[0]).sin() * x[1].exp());
        let found = fitted(&points, &responses).fit_error().residuals.clone();
        for run in 0..12 {
            let others: Vec<usize> = (0..12).filter(|i| *i != run).collect();
            let without = fitted(&points.select_rows(&others), &responses.select_rows(&others));
            let expected = responses[(run, 0)] - without.mean(&points.select_rows(&[run]))[(0, 0)];
            assert!((found[(run, 0)] - expected).abs() < 1e-9, "{expected}");
        }
    }
}

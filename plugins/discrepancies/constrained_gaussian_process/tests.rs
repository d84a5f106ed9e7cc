//! The likelihood against the dense normal density, rejection sampling, and finite differences.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{Known, Likelihood};
use lacuna_linalg::{Matrix, symmetric_eigen};

use super::ConstrainedGaussianProcess;
use super::likelihood::ConstrainedLikelihood;
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, Written, close, common, data, has_its_derivatives, options, random_matrix,
    shared,
};

fn build(text: &str, data: &Measurements) -> ConstrainedLikelihood {
    let chosen: ConstrainedGaussianProcess = options("constrained_gaussian_process", text).unwrap();
    ConstrainedLikelihood::under(&chosen, &Known::without_slopes(data, &[common(5)]), data).unwrap()
}

const SIZES: &str = "bias = { half_normal = 1 }\ncorrelation_length = { half_normal = 1 }\n\
    variance = { half_normal = 1 }\n";

/// Times in units of 1e-4 s.
fn rescaled(seed: u64) -> Measurements {
    let mut data = data(seed, 4);
    let grid = (0..TIMES).map(|j| j as f64 + 0.1 * (j * j) as f64).collect();
    data.layout.axes[1] = Axis::grid("time", grid, Unit::dimensionless());
    data
}

/// A bias that is zero with slope 0.5 at the origin, its covariance by the formula of conditional normal distributions
/// with the squared exponential's derivatives (Rasmussen and Williams 2006, 9.4).
#[test]
fn known_values_and_slopes_are_conditions() {
    let data = rescaled(1);
    let text = format!(
        "{SIZES}kernel = \"squared_exponential\"\nknown = [{{ at = 0.0, value = 0.3, slope = 0.5 }}]"
    );
    let likelihood = build(&text, &data);
    let (sd, length, noise) = (0.8_f64, 1.7, 0.3);
    let response = random_matrix(1, OUTPUTS, 2);
    let grid: Vec<f64> = (0..TIMES).map(|j| j as f64 + 0.1 * (j * j) as f64).collect();
    let k = |x: f64, y: f64| sd * sd * (-0.5 * ((x - y) / length).powi(2)).exp();
    // Value and slope at zero are uncorrelated.
    let by = |x: f64| k(x, 0.0) * x / (length * length);
    let slope_variance = sd * sd / (length * length);
    let bias = |x: f64, y: f64| {
        k(x, y) - k(x, 0.0) * k(y, 0.0) / (sd * sd) - by(x) * by(y) / slope_variance
    };
    let mean = |x: f64| 0.3 * k(x, 0.0) / (sd * sd) + 0.5 * by(x) / slope_variance;
    let error = [common(5)];
    let of_error = shared(&error);
    let both = |i: usize, j: usize| {
        let own = if i / TIMES == j / TIMES { bias(grid[i % TIMES], grid[j % TIMES]) } else { 0.0 };
        of_error(i, j) + own
    };
    let moved: Vec<f64> =
        response.row(0).iter().enumerate().map(|(i, y)| y + mean(grid[i % TIMES])).collect();
    let written = Written::new(&data, &moved, both, |i, j| if i == j { noise } else { 0.0 });
    let hyper = [sd, length, noise];
    close(likelihood.log_likelihood(response.row(0), &hyper), written.log_density(), 1e-10);
    let left_out = likelihood.left_out(response.row(0), &hyper).unwrap();
    left_out.iter().zip(written.left_out()).for_each(|(f, e)| close(*f, e, 1e-8));
    has_its_derivatives(&likelihood, response.row(0), &hyper);
    // The prior mean of the square.
    let told = &likelihood.predictive(response.row(0), &hyper)[1].variance;
    for i in 0..OUTPUTS {
        let x = grid[i % TIMES];
        close(told[i], bias(x, x).max(0.0) + mean(x).powi(2), 1e-9);
    }
}

/// Every derivative, with each kernel and condition, for several series with common errors.
#[test]
fn gradients_are_the_derivatives() {
    let data = rescaled(3);
    let response = random_matrix(1, OUTPUTS, 5);
    for text in [
        "monotone = \"increasing\"\nplaces = 4",
        "sign = \"negative\"\nplaces = 3\nkernel = \"squared_exponential\"\nbetween = [1.0, 9.0]",
        "sign = \"positive\"\nmonotone = \"decreasing\"\nplaces = 2\nkernel = \"matern_3_2\"\n\
         known = [{ at = -1.0, value = 0.2 }]",
    ] {
        let likelihood = build(&format!("{SIZES}{text}"), &data);
        has_its_derivatives(&likelihood, response.row(0), &[0.8, 1.9, 0.6]);
    }
}

/// One series of a few values.
fn line(values: &[(f64, f64)]) -> Measurements {
    let layout = Layout {
        name: "work".into(),
        unit: Unit::dimensionless(),
        axes: vec![Axis::grid(
            "effort",
            values.iter().map(|(x, _)| *x).collect(),
            Unit::dimensionless(),
        )],
    };
    let replicate = Replicate::new("1", values.iter().map(|(_, y)| Some(*y)).collect());
    Measurements::new(layout, vec![replicate])
}

/// The marginal likelihood of a decreasing bias, as the mean density of the data over draws of the prior that decrease
/// at the places: rejection sampling, which shares no formula with the implementation.
#[test]
fn it_is_the_mean_over_the_draws_that_satisfy_the_conditions() {
    const DRAWS: u64 = 60_000;
    const GIVEN: u64 = 2000;
    let xs = [0.5, 1.5, 2.5, 4.0];
    let data = line(&[(0.5, 0.1), (1.5, -0.2), (2.5, -0.1), (4.0, -0.9)]);
    let text = "bias = { known = 0.7 }\ncorrelation_length = { known = 1.5 }\n\
        variance = { known = 0.04 }\nkernel = \"squared_exponential\"\nmonotone = \"decreasing\"\n\
        places = 4\nbetween = [0.0, 4.0]";
    let chosen: ConstrainedGaussianProcess = options("constrained_gaussian_process", text).unwrap();
    let likelihood =
        ConstrainedLikelihood::under(&chosen, &Known::without_slopes(&data, &[]), &data).unwrap();
    let places = [0.0, 4.0 / 3.0, 8.0 / 3.0, 4.0];
    // Values, then slopes, of a process of standard deviation 0.7 and length 1.5.
    let k = |a: usize, b: usize| {
        let at = |i: usize| if i < 4 { xs[i] } else { places[i - 4] };
        let l = 1.5_f64;
        let u = (at(a) - at(b)) / l;
        let e = 0.49 * (-0.5 * u * u).exp();
        match (a < 4, b < 4) {
            (true, true) => e,
            (false, true) => -u * e / l,
            (true, false) => u * e / l,
            (false, false) => (1.0 - u * u) * e / (l * l),
        }
    };
    let eigen = symmetric_eigen(&Matrix::from_fn(8, 8, k)).unwrap();
    let root =
        Matrix::from_fn(8, 8, |i, j| eigen.vectors[(i, j)] * eigen.values[j].max(0.0).sqrt());
    let ys = [0.1, -0.2, -0.1, -0.9];
    let (mut kept, mut sum, mut squares, mut size) = (0.0, 0.0, 0.0, [0.0; 4]);
    let mut after = [[0.0; 4]; 2];
    for i in 0..DRAWS {
        let mut rng = Stream::root(11).at(i).generator();
        let z: Vec<f64> = (0..8).map(|_| normal(&mut rng)).collect();
        let f = lacuna_linalg::multiply_vector(&root, &z);
        if f[4..].iter().any(|slope| *slope > 0.0) {
            continue;
        }
        let twice: f64 = f.iter().zip(ys).map(|(b, y)| (y - b).powi(2) / 0.04).sum();
        let density = (-0.5 * twice).exp() / (std::f64::consts::TAU * 0.04).powi(2);
        kept += 1.0;
        sum += density;
        squares += density * density;
        for (i, b) in f[..4].iter().enumerate() {
            size[i] += b * b;
            after[0][i] += density * b;
            after[1][i] += density * b * b;
        }
    }
    let mean: f64 = sum / kept;
    let error = ((squares / kept - mean * mean) / kept).sqrt() / mean;
    let found = likelihood.log_likelihood(&[0.0; 4], &[]);
    // The softness of the conditions and the lattice change the logarithm by about a hundredth.
    assert!((found - mean.ln()).abs() < 4.0 * error + 0.01, "{found} {} {error}", mean.ln());
    let told = &likelihood.predictive(&[0.0; 4], &[])[1].variance;
    for (told, size) in told.iter().zip(size) {
        assert!((told / (size / kept) - 1.0).abs() < 0.06, "{told} {}", size / kept);
    }
    // Draws given the data: mean and standard deviation of the weighted draws of the prior, whose effective number is
    // `sum² / squares`.
    let mut given = [[0.0; 4]; 2];
    for k in 0..GIVEN {
        let drawn = likelihood.errors_given_data(&[0.0; 4], &[], &Stream::root(12).at(k)).unwrap();
        for (i, b) in drawn[1].values.iter().enumerate() {
            given[0][i] += b / GIVEN as f64;
            given[1][i] += b * b / GIVEN as f64;
        }
    }
    let share = (squares / (sum * sum) + 1.0 / GIVEN as f64).sqrt();
    for i in 0..4 {
        let [mean, square] = [after[0][i] / sum, after[1][i] / sum];
        let sd = (square - mean * mean).sqrt();
        let own = (given[1][i] - given[0][i] * given[0][i]).sqrt();
        assert!((given[0][i] - mean).abs() < 4.0 * sd * share, "{i}: {} {mean} {sd}", given[0][i]);
        assert!((own / sd - 1.0).abs() < 4.0 * share, "{i}: {own} {sd}");
    }
}

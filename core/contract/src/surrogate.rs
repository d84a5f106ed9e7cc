//! Contract of surrogates.

mod axes;

use lacuna::data::{Layouts, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::matrix::vector::dot;
use lacuna::matrix::{Matrix, transposed_multiply_vector};
use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{Emulator, Indices, Summand, Surrogate, Training};
use lacuna::run::{Progress, Silent};

use crate::judge::{Check, agree, calm, judge, layout, refused, same_on_threads, slope};

/// Tests a surrogate against its contract, on 60 runs of a smooth function of two parameters with ten outputs, one of
/// which is constant.
///
/// - Shapes are right and all numbers finite; ninety per cent of the variance at new points is explained.
/// - Several points at once give the same results as one by one.
/// - The Jacobian, and the gradient of the basis if the emulator is linear, agree with finite differences; a linear
///   emulator is the product of its basis and its coefficients, and its sums of squares are correct to within their
///   stated error.
/// - Sobol' indices are fractions: first-order no larger than total, between 0 and 1.
/// - A surrogate that takes derivatives is better with those of 15 runs, one of which has none, than without.
/// - A weighted sum of emulators, if implemented, has the sum of their responses and slopes.
/// - A surrogate for rotated outputs, if implemented, fits the rotated emulator of many outputs.
/// - The covariances of its errors between points, if known, are symmetric, and no variance that follows from them
///   exceeds the one that the emulator states.
/// - It is restored from its bytes bit for bit, and damaged bytes are rejected.
/// - The same runs give the same bytes, on any number of threads.
/// - Runs that are too few, of unequal number or not finite are rejected.
pub fn surrogate(name: &str, surrogate: &dyn Surrogate) -> Result<(), Vec<String>> {
    let problem = Problem::new();
    let checks: [Check<'_>; 10] = [
        ("emulates", Box::new(|| emulates(surrogate, &problem))),
        ("knows its derivatives", Box::new(|| knows_its_derivatives(surrogate, &problem))),
        ("learns from derivatives", Box::new(|| learns_from_derivatives(surrogate, &problem))),
        ("shares out the variance", Box::new(|| shares_out_the_variance(surrogate, &problem))),
        ("knows its errors", Box::new(|| knows_its_errors(surrogate, &problem))),
        ("adds up", Box::new(|| adds_up(surrogate, &problem))),
        ("does not depend on axes", Box::new(|| axes::turns(surrogate, &problem))),
        ("reads back", Box::new(|| reads_back(surrogate, &problem))),
        ("repeats itself", Box::new(|| same_on_threads(|| problem.bytes(surrogate)))),
        ("refuses bad runs", Box::new(|| refuses_bad_runs(surrogate, &problem))),
    ];
    judge("surrogate", name, &checks)
}

struct Problem {
    parameters: Vec<Parameter>,
    layouts: Layouts,
    points: Matrix,
    responses: Matrix,
    /// Points that belong to no run.
    fresh: Matrix,
}

const RUNS: usize = 60;
/// Index of the constant output.
const CONSTANT: usize = 3;

fn truth(point: &[f64]) -> Vec<f64> {
    let (a, b) = (point[0], (point[1] - 20.0) / 10.0);
    let output = |i: usize| {
        let w = i as f64 / 4.0;
        if i == CONSTANT { 2.0 } else { (a + w * b).sin() + 0.3 * w * a * b + b * b }
    };
    (0..10).map(output).collect()
}

impl Problem {
    fn new() -> Self {
        let parameter = |name: &str, range: [f64; 2]| Parameter {
            name: name.to_owned(),
            symbol: name.to_owned(),
            unit: Unit::dimensionless(),
            design: Distribution::Uniform(range),
            prior: Distribution::Uniform(range),
            reference: None,
        };
        let parameters = vec![parameter("a", [-1.0, 1.0]), parameter("b", [10.0, 30.0])];
        let draw = |count: usize, label: &str| {
            let mut rng = Stream::root(5).named(label).generator();
            Matrix::from_fn(count, 2, |_, j| parameters[j].design.quantile(uniform(&mut rng)))
        };
        let (points, fresh) = (draw(RUNS, "runs"), draw(40, "fresh"));
        let responses = Matrix::from_rows(10, points.iter_rows().map(truth));
        Self { parameters, layouts: layout().into(), points, responses, fresh }
    }

    fn fit(&self, surrogate: &dyn Surrogate) -> Result<Box<dyn Emulator>, String> {
        let fitted = self.fit_to(surrogate, &self.points, &self.responses, None);
        fitted.map_err(|stop| format!("sound runs are refused: {stop}"))
    }

    fn fit_to(
        &self,
        surrogate: &dyn Surrogate,
        points: &Matrix,
        responses: &Matrix,
        gradients: Option<&Matrix>,
    ) -> Result<Box<dyn Emulator>, lacuna::run::Stop> {
        let (parameters, layouts) = (&self.parameters, &self.layouts);
        let training = Training { parameters, layouts, points, responses, gradients };
        let stream = Stream::root(6).named("surrogate");
        surrogate.fit(&training, &stream, &Progress::new(&Silent))
    }

    fn bytes(&self, surrogate: &dyn Surrogate) -> Result<Vec<u8>, String> {
        self.fit(surrogate)?.save().map_err(|stop| format!("it cannot be saved: {stop}"))
    }
}

fn shaped(what: &str, m: &Matrix, rows: usize, columns: usize) -> Result<(), String> {
    if (m.rows(), m.columns()) != (rows, columns) {
        let (found, other) = (m.rows(), m.columns());
        return Err(format!("{what} is {found} x {other} and not {rows} x {columns}"));
    }
    match m.as_slice().iter().find(|x| !x.is_finite()) {
        Some(x) => Err(format!("{what} holds {x}")),
        None => Ok(()),
    }
}

fn emulates(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let emulator = problem.fit(surrogate)?;
    if (emulator.dimension(), emulator.outputs()) != (2, 10) {
        return Err("it has other numbers of parameters or outputs than the runs".into());
    }
    let mean = emulator.mean(&problem.fresh);
    shaped("the mean", &mean, 40, 10)?;
    shaped("the residuals", &emulator.fit_error().residuals, RUNS, 10)?;
    let relative = &emulator.fit_error().relative;
    if relative.len() != 10 || relative.iter().any(|e| !(e.is_finite() && *e >= 0.0)) {
        return Err(format!("the relative errors are {relative:?}"));
    }
    if let Some(variance) = emulator.variance(&problem.fresh) {
        shaped("the variance", &variance, 40, 10)?;
        if variance.as_slice().iter().any(|v| *v < 0.0) {
            return Err("a variance is negative".into());
        }
    }
    let exact = Matrix::from_rows(10, problem.fresh.iter_rows().map(truth));
    for i in 0..10 {
        let (found, right) = (mean.column(i), exact.column(i));
        let centre = right.iter().sum::<f64>() / 40.0;
        let variance: f64 = right.iter().map(|y| (y - centre).powi(2)).sum();
        let error: f64 = found.iter().zip(&right).map(|(a, b)| (a - b).powi(2)).sum();
        if error > 0.1 * variance + 1e-18 {
            return Err(format!("output {} is explained by {}", i + 1, 1.0 - error / variance));
        }
    }
    for (i, point) in problem.fresh.iter_rows().enumerate().take(5) {
        let alone = emulator.mean(&Matrix::from_vec(1, 2, point.to_vec()));
        agree("alone, output", alone.row(0), mean.row(i), 1e-11)?;
    }
    Ok(())
}

fn learns_from_derivatives(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    if surrogate.takes_gradients().is_err() {
        return Ok(());
    }
    let few: Vec<usize> = (0..15).collect();
    let (points, responses) =
        (problem.points.select_rows(&few), problem.responses.select_rows(&few));
    let of_run = |point: &[f64]| -> Vec<f64> {
        let by = |j: usize, step: f64| slope(truth, point, j, step);
        by(0, 1e-5).into_iter().zip(by(1, 1e-4)).flat_map(|(a, b)| [a, b]).collect()
    };
    let mut gradients = Matrix::from_rows(20, points.iter_rows().map(of_run));
    gradients.row_mut(4).fill(f64::NAN);
    let exact = Matrix::from_rows(10, problem.fresh.iter_rows().map(truth));
    let error = |gradients: Option<&Matrix>| -> Result<f64, String> {
        let fitted = problem.fit_to(surrogate, &points, &responses, gradients);
        let mean = fitted.map_err(|stop| stop.to_string())?.mean(&problem.fresh);
        shaped("the mean", &mean, 40, 10)?;
        let pairs = mean.as_slice().iter().zip(exact.as_slice());
        Ok(pairs.map(|(a, b)| (a - b).powi(2)).sum())
    };
    // Options may need more runs than these.
    let Ok(without) = error(None) else { return Ok(()) };
    let with = error(Some(&gradients))?;
    if with < without {
        return Ok(());
    }
    Err(format!("the sum of squared errors is {with} with derivatives, {without} without"))
}

fn knows_its_derivatives(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let emulator = problem.fit(surrogate)?;
    let at = |point: &[f64]| Matrix::from_vec(1, 2, point.to_vec());
    for point in problem.fresh.iter_rows().take(5) {
        let jacobian = emulator.jacobian(point);
        shaped("the Jacobian", &jacobian, 10, 2)?;
        for (j, step) in [1e-5, 1e-4].into_iter().enumerate() {
            let mean = |x: &[f64]| emulator.mean(&at(x)).into_vec();
            let differences = slope(mean, point, j, step);
            let what = format!("the derivative by parameter {} of output", j + 1);
            agree(&what, &jacobian.column(j), &differences, 1e-5)?;
            let Some(linear) = emulator.linear() else { continue };
            let basis = |x: &[f64]| linear.basis(&at(x)).into_vec();
            let gradient = linear.basis_gradient(point).column(j);
            let what = format!("the derivative by parameter {} of term", j + 1);
            agree(&what, &gradient, &slope(basis, point, j, step), 1e-5)?;
        }
    }
    if let Some(linear) = emulator.linear() {
        let (basis, mean) = (linear.basis(&problem.fresh), emulator.mean(&problem.fresh));
        for (terms, mean) in basis.iter_rows().zip(mean.iter_rows()) {
            let product = transposed_multiply_vector(linear.coefficients(), terms);
            agree("basis times coefficients, entry", &product, mean, 1e-11)?;
        }
        sums_squares(linear, &problem.fresh)?;
    }
    Ok(())
}

/// Compares the fast form of a sum of squares with the explicit product.
fn sums_squares(linear: &dyn Linear, points: &Matrix) -> Result<(), String> {
    let terms = linear.coefficients().rows();
    let mut rng = Stream::root(11).generator();
    let factor = Matrix::from_fn(terms + 3, terms + 1, |_, _| normal(&mut rng));
    let Some(form) = linear.sum_of_squares(&factor) else { return Ok(()) };
    let values = form.values(points);
    for (i, point) in points.iter_rows().enumerate().filter(|(_, point)| form.covers(point)) {
        let psi = linear.basis(&Matrix::from_vec(1, point.len(), point.to_vec()));
        let extended: Vec<f64> = psi.row(0).iter().copied().chain([1.0]).collect();
        let squares = factor.iter_rows().map(|row| dot(row, &extended).powi(2));
        let expected: f64 = squares.sum();
        if (values[i] - expected).abs() > form.error() + 1e-12 * expected {
            let (found, error) = (values[i], form.error());
            return Err(format!("a sum of squares is {found} +- {error} and not {expected}"));
        }
    }
    Ok(())
}

fn shares_out_the_variance(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let Some(sensitivity) = problem.fit(surrogate)?.sensitivity() else { return Ok(()) };
    for (name, list) in [("mean", &sensitivity.mean), ("variance", &sensitivity.variance)] {
        if list.len() != 10 || list.iter().any(|x| !x.is_finite()) {
            return Err(format!("the {name} of the outputs is {list:?}"));
        }
    }
    shares("outputs", &sensitivity.outputs, 10, sensitivity.pairs.len())?;
    shares("aggregated", &sensitivity.aggregated, 1, sensitivity.pairs.len())?;
    if sensitivity.outputs.total.row(CONSTANT).iter().any(|s| *s != 0.0) {
        return Err("an output that does not vary has shares".into());
    }
    Ok(())
}

/// Compares the sum of an emulator of all runs and one of half of them with the sum of their results.
fn knows_its_errors(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let emulator = problem.fit(surrogate)?;
    let Some(processes) = emulator.processes() else { return Ok(()) };
    let variance = emulator.variance(&problem.fresh);
    let variance =
        variance.ok_or("it knows the covariance of its errors, but states no variance")?;
    let (directions, noise) = (processes.directions(), processes.noise());
    let all = processes.covariances(&problem.fresh);
    if directions.columns() != problem.responses.columns()
        || [all.len(), noise.len()] != [directions.rows(); 2]
    {
        return Err("its errors have directions, covariances and noise of unequal number".into());
    }
    for (k, covariance) in all.iter().enumerate() {
        let largest = (0..covariance.rows()).map(|i| covariance[(i, i)]).fold(0.0, f64::max);
        for i in 0..covariance.rows() {
            for j in 0..i {
                let (a, b) = (covariance[(i, j)], covariance[(j, i)]);
                if !(a.is_finite() && (a - b).abs() <= 1e-9 * largest) {
                    return Err(format!(
                        "covariance {k} between points {i} and {j} is {a} and {b}"
                    ));
                }
            }
        }
    }
    for (i, row) in variance.iter_rows().enumerate() {
        for (j, stated) in row.iter().enumerate() {
            let part = |k: usize| (all[k][(i, i)] + noise[k]) * directions[(k, j)].powi(2);
            let sum: f64 = (0..all.len()).map(part).sum();
            if sum > stated * (1.0 + 1e-6) + f64::MIN_POSITIVE {
                return Err(format!(
                    "its errors have the variance {sum} at output {j}, it states {stated}"
                ));
            }
        }
    }
    Ok(())
}

fn adds_up(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let half: Vec<usize> = (0..RUNS / 2).collect();
    let few = (problem.points.select_rows(&half), problem.responses.select_rows(&half));
    let first = problem.fit(surrogate)?;
    let Ok(second) = problem.fit_to(surrogate, &few.0, &few.1, None) else { return Ok(()) };
    let weights = [(0..10).map(|j| 0.5 + f64::from(j)).collect::<Vec<f64>>(), vec![-0.25; 10]];
    let offset: Vec<f64> = (0..10).map(|j| f64::from(j) - 3.0).collect();
    let bytes = [&first, &second].map(|e| e.save().map_err(|stop| stop.to_string()));
    let [one, two] = bytes;
    let (one, two) = (one?, two?);
    let parts = [
        Summand { bytes: &one, weights: &weights[0] },
        Summand { bytes: &two, weights: &weights[1] },
    ];
    let sum = surrogate.sum(&parts, &offset).map_err(|stop| format!("no sum: {stop}"))?;
    let Some(sum) = sum else { return Ok(()) };
    let weighted = |a: &Matrix, b: &Matrix, start: &dyn Fn(usize) -> f64| {
        Matrix::from_fn(a.rows(), a.columns(), |i, j| {
            start(j) + weights[0][j] * a[(i, j)] + weights[1][j] * b[(i, j)]
        })
    };
    let points = &problem.fresh;
    let expected = weighted(&first.mean(points), &second.mean(points), &|j| offset[j]);
    agree("the sum, entry", sum.mean(points).as_slice(), expected.as_slice(), 1e-9)?;
    let slopes = |e: &dyn Emulator| e.jacobian(points.row(0)).transposed();
    let expected = weighted(&slopes(&*first), &slopes(&*second), &|_| 0.0);
    agree("the sum's slopes, entry", slopes(&*sum).as_slice(), expected.as_slice(), 1e-9)?;
    let damaged = [Summand { bytes: &one[..one.len() / 2], weights: &weights[0] }];
    refused("a sum of damaged bytes", || surrogate.sum(&damaged, &offset))
}

fn shares(what: &str, indices: &Indices, rows: usize, pairs: usize) -> Result<(), String> {
    const ROUNDING: f64 = 1e-9;
    for (name, m, columns) in [
        ("first", &indices.first, 2),
        ("total", &indices.total, 2),
        ("pairs", &indices.pairs, pairs),
    ] {
        shaped(&format!("{what}.{name}"), m, rows, columns)?;
        if m.as_slice().iter().any(|s| !(-ROUNDING..=1.0 + ROUNDING).contains(s)) {
            return Err(format!("{what}.{name} holds what is no share"));
        }
    }
    let ordered = indices.first.as_slice().iter().zip(indices.total.as_slice());
    if ordered.into_iter().any(|(first, total)| *first > total + ROUNDING) {
        return Err(format!("in {what} a first-order share is above its total"));
    }
    Ok(())
}

fn reads_back(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let emulator = problem.fit(surrogate)?;
    let bytes = emulator.save().map_err(|stop| format!("it cannot be saved: {stop}"))?;
    let read = surrogate.load(&bytes).map_err(|stop| format!("its bytes are refused: {stop}"))?;
    let same = read.mean(&problem.fresh) == emulator.mean(&problem.fresh)
        && read.jacobian(problem.fresh.row(0)) == emulator.jacobian(problem.fresh.row(0))
        && read.fit_error() == emulator.fit_error()
        && read.facts() == emulator.facts();
    if !same {
        return Err("it is another one after reading".into());
    }
    if read.save().map_err(|stop| stop.to_string())? != bytes {
        return Err("its bytes are others after reading".into());
    }
    for length in [0, 1, bytes.len() / 3, bytes.len() / 2, bytes.len() - 1] {
        refused(&format!("{length} of its bytes"), || surrogate.load(&bytes[..length]))?;
    }
    refused("another file", || surrogate.load(b"this is something else altogether"))?;
    for place in (0..bytes.len()).step_by(bytes.len() / 60 + 1) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x11;
        calm(&format!("a damaged byte {place}"), || surrogate.load(&damaged).is_ok())?;
    }
    Ok(())
}

fn refuses_bad_runs(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let spoilt = |matrix: &Matrix, value: f64| {
        let mut matrix = matrix.clone();
        matrix[(7, 1)] = value;
        matrix
    };
    let (points, responses) = (&problem.points, &problem.responses);
    let short = responses.select_rows(&(1..RUNS).collect::<Vec<_>>());
    let none = (Matrix::zeros(0, 2), Matrix::zeros(0, 10));
    for (what, points, responses) in [
        ("a response that is not a number", points, &spoilt(responses, f64::NAN)),
        ("an infinite response", points, &spoilt(responses, f64::INFINITY)),
        ("a parameter that is not a number", &spoilt(points, f64::NAN), responses),
        ("a run without a response", points, &short),
        ("a fit to no runs", &none.0, &none.1),
    ] {
        refused(what, || problem.fit_to(surrogate, points, responses, None))?;
    }
    Ok(())
}

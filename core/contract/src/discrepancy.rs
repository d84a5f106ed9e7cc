//! Contract of discrepancies.

mod draws;
mod parts;

use std::sync::OnceLock;

use lacuna::data::{Measurements, Parameter, Replicate};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::matrix::{Matrix, multiply_vector, transposed_multiply_vector};
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{CommonError, Known, Likelihood};
use lacuna::plugin::forward::Linear;
use lacuna::run::Stop;

use self::draws::{
    draws_errors_given_the_data, draws_the_errors_it_predicts, has_the_law_that_it_simulates,
    simulates_what_it_predicts,
};
use self::parts::stands_for_parts;
use crate::judge::{Check, agree, calm, judge, layout, refused, slope, twice};

/// Tests a discrepancy against its contract, on five replicates of ten outputs with missing values, one output never
/// measured, with and without errors common to all replicates.
///
/// - Hyperparameters have distinct names, and starting values of nonzero prior density.
/// - The likelihood is finite at the start, reproducible, larger for a response that fits than for one far off, and
///   never a number for invalid hyperparameters.
/// - Its derivatives agree with finite differences, and are zero by outputs that were not measured.
/// - The density of a value given all others, if implemented, is the quotient of the likelihoods with and without the
///   value; and of those of all data and of the part without it, if that form is implemented. A likelihood that gives that of
///   a part itself gives the same values and derivatives.
/// - Reduced to a linear emulator it is the same function, with the same derivatives.
/// - Simulated data have the missing values of the measurements, and the variance predicted for a new replicate, within
///   five Monte Carlo errors.
/// - The likelihood is that of the data which are simulated, unless its law follows from the data: the identities of Bartlett
///   hold within five Monte Carlo errors.
/// - The errors of a new replicate are those of its predicted variance: one path for each origin, with that variance within
///   five Monte Carlo errors, and the same from the same stream.
/// - The errors given the data, if that form is implemented, are finite, one path for each origin, and the same from the
///   same stream.
/// - Slopes of the model that are not available do not cause a panic.
/// - Data without values, with non-finite values or of another layout are rejected.
pub fn discrepancy(name: &str, discrepancy: &dyn Discrepancy) -> Result<(), Vec<String>> {
    let over = |check: fn(&dyn Likelihood) -> Result<(), String>, last: CommonError| {
        move || {
            let emulator = || common("emulator", true);
            for errors in [vec![], vec![emulator()], vec![emulator(), last.clone()]] {
                let built = discrepancy.likelihood(&known(&data(), &errors));
                check(&*built.map_err(|stop| format!("sound data are refused: {stop}"))?)?;
            }
            Ok(())
        }
    };
    // An error of the data's mean concerns existing data, not a new replicate.
    let (of_data, of_model) = (|| common("replicates", false), || common("numerics", true));
    let checks: [Check<'_>; 11] = [
        ("has sound hyperparameters", Box::new(over(has_sound_hyperparameters, of_data()))),
        ("judges responses", Box::new(over(judges_responses, of_data()))),
        ("knows its derivatives", Box::new(over(knows_its_derivatives, of_data()))),
        ("leaves values out", Box::new(|| leaves_values_out(discrepancy))),
        ("stands for parts", Box::new(|| stands_for_parts(discrepancy))),
        ("compresses exactly", Box::new(over(compresses_exactly, of_data()))),
        ("simulates what it predicts", Box::new(over(simulates_what_it_predicts, of_model()))),
        ("has the law that it simulates", Box::new(|| has_the_law_that_it_simulates(discrepancy))),
        ("draws the errors it predicts", Box::new(over(draws_the_errors_it_predicts, of_model()))),
        ("draws errors given the data", Box::new(over(draws_errors_given_the_data, of_model()))),
        ("refuses bad data", Box::new(|| refuses_bad_data(discrepancy))),
    ];
    judge("discrepancy", name, &checks)
}

const OUTPUTS: usize = 10;
/// The output that no replicate measured.
const UNMEASURED: usize = 6;

fn truth() -> Vec<f64> {
    (0..OUTPUTS).map(|i| 1.0 + (0.7 * i as f64).sin()).collect()
}

fn data() -> Measurements {
    let replicate = |r: usize| {
        let mut rng = Stream::root(7).at(r as u64).generator();
        let value = |(i, y): (usize, &f64)| {
            let measured = y + 0.2 * normal(&mut rng);
            (i != UNMEASURED && (r == 0 || !(i + r).is_multiple_of(3))).then_some(measured)
        };
        let values = truth().iter().enumerate().map(value).collect();
        Replicate::new(format!("p{r}"), values)
    };
    Measurements::new(layout(), (0..5).map(replicate).collect())
}

/// An error common to all replicates, about a quarter of the scatter of the data.
fn common(origin: &str, predictive: bool) -> CommonError {
    let mut rng = Stream::root(8).named(origin).generator();
    let factor = Matrix::from_fn(OUTPUTS, 2, |_, _| 0.05 * normal(&mut rng));
    CommonError { origin: origin.to_owned().into(), factor: factor.into(), predictive }
}

/// Slopes for two parameters, of which the second has little influence.
#[expect(clippy::unnecessary_wraps, reason = "slopes may fail where a study computes them")]
fn slopes() -> Result<Matrix, Stop> {
    Ok(Matrix::from_fn(OUTPUTS, 2, |i, j| (0.3 * i as f64).cos() / (1.0 + 100.0 * j as f64)))
}

/// The parameters of the slopes.
fn parameters() -> &'static [Parameter] {
    static BOTH: OnceLock<[Parameter; 2]> = OnceLock::new();
    BOTH.get_or_init(|| {
        ["first", "second"].map(|name| Parameter::plain(name, Distribution::Normal([0.0, 2.0])))
    })
}

fn known<'a>(data: &'a Measurements, common: &'a [CommonError]) -> Known<'a> {
    Known { data, common, slopes: &slopes, parameters: parameters() }
}

fn start(likelihood: &dyn Likelihood) -> Vec<f64> {
    likelihood.hyperparameters().iter().map(|h| h.start).collect()
}

fn has_sound_hyperparameters(likelihood: &dyn Likelihood) -> Result<(), String> {
    let hyper = likelihood.hyperparameters();
    if let Some(name) = twice(hyper.iter().map(|h| h.name.as_str())) {
        return Err(format!("two are called `{name}`"));
    }
    for h in hyper {
        if !h.prior.log_density(h.start).is_finite() || (h.log && h.start <= 0.0) {
            return Err(format!("`{}` starts at {}, where its prior is zero", h.name, h.start));
        }
    }
    Ok(())
}

fn judges_responses(likelihood: &dyn Likelihood) -> Result<(), String> {
    let (truth, start) = (truth(), start(likelihood));
    let value = likelihood.log_likelihood(&truth, &start);
    if !value.is_finite() {
        return Err(format!("it is {value} at the start"));
    }
    if likelihood.log_likelihood(&truth, &start) != value {
        return Err("the same response has another likelihood".into());
    }
    let far: Vec<f64> = truth.iter().map(|y| y + 10.0).collect();
    if likelihood.log_likelihood(&far, &start) >= value {
        return Err("a response far from the data is as likely as one near them".into());
    }
    for (j, h) in likelihood.hyperparameters().iter().enumerate() {
        let outside = h.prior.support().0 - 1.0;
        for bad in [f64::NAN, outside].into_iter().filter(|x| !x.is_infinite()) {
            let mut hyper = start.clone();
            hyper[j] = bad;
            let what = format!("`{}` = {bad}", h.name);
            let found = calm(&what, || likelihood.log_likelihood(&truth, &hyper))?;
            if found.is_nan() || (bad.is_nan() && found.is_finite()) {
                return Err(format!("it is {found} for {what}"));
            }
        }
    }
    Ok(())
}

fn knows_its_derivatives(likelihood: &dyn Likelihood) -> Result<(), String> {
    let start = start(likelihood);
    let response: Vec<f64> = truth().iter().map(|y| 1.1 * y).collect();
    let (by_response, by_hyper) = likelihood.gradient(&response, &start);
    let differences: Vec<f64> = (0..OUTPUTS)
        .map(|i| slope(|y| vec![likelihood.log_likelihood(y, &start)], &response, i, 1e-5)[0])
        .collect();
    agree("the derivative by output", &by_response, &differences, 1e-6)?;
    if by_response[UNMEASURED] != 0.0 {
        return Err("an output that was not measured has a derivative".into());
    }
    let by = |j: usize| {
        let step = 1e-5 * start[j].abs().max(1e-3);
        slope(|h| vec![likelihood.log_likelihood(&response, h)], &start, j, step)[0]
    };
    let differences: Vec<f64> = (0..start.len()).map(by).collect();
    agree("the derivative by hyperparameter", &by_hyper, &differences, 1e-5)
}

/// Each value's density given all others, and the data without it, in the order of the data.
fn without_each(data: &Measurements, given: &[f64]) -> Vec<(f64, Measurements)> {
    let mut next = given.iter();
    let mut all = Vec::new();
    for (r, replicate) in data.replicates.iter().enumerate() {
        for i in (0..OUTPUTS).filter(|&i| replicate.values[i].is_some()) {
            let mut less = data.clone();
            less.replicates[r].values[i] = None;
            all.push((next.next().copied().unwrap_or(f64::NAN), less));
        }
    }
    all
}

/// The likelihood of other data is comparable only if it has the same distribution: a discrepancy may estimate
/// variances from the data, which its predictions then show.
fn leaves_values_out(discrepancy: &dyn Discrepancy) -> Result<(), String> {
    let (data, truth, errors) = (data(), truth(), [common("emulator", true)]);
    let build = |data: &Measurements| {
        let built = discrepancy.likelihood(&known(data, &errors));
        built.map_err(|stop| format!("sound data are refused: {stop}"))
    };
    let whole = build(&data)?;
    let hyper = start(&*whole);
    let Some(given) = whole.left_out(&truth, &hyper) else { return Ok(()) };
    if given.len() != data.count() {
        return Err(format!("{} densities of {} values", given.len(), data.count()));
    }
    let total = |likelihood: &dyn Likelihood| -> Vec<f64> {
        let parts = likelihood.predictive(&truth, &hyper);
        (0..OUTPUTS).map(|i| parts.iter().map(|p| p.variance[i]).sum()).collect()
    };
    let (law, value) = (total(&*whole), whole.log_likelihood(&truth, &hyper));
    let (mut densities, mut quotients) = (Vec::new(), Vec::new());
    for (density, less) in without_each(&data, &given) {
        let less = build(&less)?;
        let same_names = || {
            let names = |l: &dyn Likelihood| -> Vec<String> {
                l.hyperparameters().iter().map(|h| h.name.clone()).collect()
            };
            names(&*less) == names(&*whole)
        };
        if same_names() && agree("the law", &total(&*less), &law, 1e-9).is_ok() {
            densities.push(density);
            quotients.push(value - less.log_likelihood(&truth, &hyper));
        }
    }
    agree("the density of value", &densities, &quotients, 1e-8)
}

/// Coefficients of four terms whose basis functions are the coordinates themselves.
struct Terms(Matrix);

impl Linear for Terms {
    fn coefficients(&self) -> &Matrix {
        &self.0
    }
    fn basis(&self, points: &Matrix) -> Matrix {
        points.clone()
    }
    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        Matrix::from_fn(point.len(), point.len(), |i, j| f64::from(u8::from(i == j)))
    }
}

fn compresses_exactly(likelihood: &dyn Likelihood) -> Result<(), String> {
    let mut rng = Stream::root(9).generator();
    let terms = Terms(Matrix::from_fn(4, OUTPUTS, |_, _| normal(&mut rng)));
    let Some(compressed) = likelihood.compress(&terms) else { return Ok(()) };
    let start = start(likelihood);
    let basis = Matrix::from_fn(6, 4, |_, _| normal(&mut rng));
    let hyper = Matrix::from_fn(6, start.len(), |i, j| start[j] * (1.0 + 0.1 * i as f64));
    let rows = basis.iter_rows().map(|row| transposed_multiply_vector(&terms.0, row));
    let responses = Matrix::from_rows(OUTPUTS, rows);
    let full: Vec<f64> =
        (0..6).map(|i| likelihood.log_likelihood(responses.row(i), hyper.row(i))).collect();
    agree("the reduced value of point", &compressed.log_likelihood(&basis, &hyper), &full, 1e-9)?;
    for i in 0..6 {
        let (by_basis, by_hyper) = compressed.gradient(basis.row(i), hyper.row(i));
        let (by_response, expected) = likelihood.gradient(responses.row(i), hyper.row(i));
        let chained = multiply_vector(&terms.0, &by_response);
        agree("the reduced derivative by term", &by_basis, &chained, 1e-8)?;
        agree("the reduced derivative by hyperparameter", &by_hyper, &expected, 1e-8)?;
    }
    Ok(())
}

fn refuses_bad_data(discrepancy: &dyn Discrepancy) -> Result<(), String> {
    let changed = |change: fn(&mut Replicate)| {
        let mut data = data();
        data.replicates.iter_mut().for_each(change);
        data
    };
    let empty = Measurements::new(layout(), Vec::new());
    for (what, data) in [
        ("no replicate", empty),
        ("data without a value", changed(|r| r.values.fill(None))),
        ("a value that is not a number", changed(|r| r.values[0] = Some(f64::NAN))),
        ("an infinite value", changed(|r| r.values[1] = Some(f64::INFINITY))),
        ("replicates of another shape", changed(|r| r.values.truncate(4))),
    ] {
        refused(what, || discrepancy.likelihood(&known(&data, &[])).map(|_| ()))?;
    }
    let sound = data();
    let without_slopes = || discrepancy.likelihood(&Known::without_slopes(&sound, &[])).is_ok();
    calm("a model without slopes", without_slopes)?;
    let rank = |rows: usize, columns: usize| {
        [CommonError { factor: Matrix::zeros(rows, columns).into(), ..common("emulator", true) }]
    };
    refused("a common error of another shape", || {
        discrepancy.likelihood(&known(&data(), &rank(OUTPUTS - 1, 2))).map(|_| ())
    })?;
    // An emulator without error must be accepted.
    for errors in [rank(OUTPUTS, 0), rank(OUTPUTS, 2)] {
        let what = "a common error of zero";
        if let Err(stop) = calm(what, || discrepancy.likelihood(&known(&data(), &errors)))? {
            return Err(format!("{what} is refused: {stop}"));
        }
    }
    Ok(())
}

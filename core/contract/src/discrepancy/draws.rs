//! Checks of the data that a discrepancy simulates and of the errors that it draws.

use lacuna::data::{Measurements, Replicate};
use lacuna::math::random::Stream;
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{ErrorPath, Likelihood, StochasticModel, VariancePart};

use super::{OUTPUTS, common, data, known, start, truth};

pub(super) fn simulates_what_it_predicts(likelihood: &dyn Likelihood) -> Result<(), String> {
    const COUNT: u64 = 2000;
    let (truth, start, data) = (truth(), start(likelihood), data());
    let parts = likelihood.predictive(&truth, &start);
    let wrong = |v: &f64| !(v.is_finite() && *v >= 0.0);
    for part in &parts {
        if part.variance.len() != OUTPUTS || part.variance.iter().any(wrong) {
            return Err(format!("the variance of origin `{}` is not sound", part.origin));
        }
    }
    let stream = Stream::root(10);
    let mut squares = vec![Vec::new(); OUTPUTS];
    for k in 0..COUNT {
        let made = likelihood.simulate(&truth, &start, &stream.at(k));
        if k == 0 && made != likelihood.simulate(&truth, &start, &stream.at(0)) {
            return Err("the same stream gives other data".into());
        }
        let [made] = &made[..] else { return Err("simulated data are not one set".into()) };
        let gaps = |m: &Measurements| -> Vec<Vec<bool>> {
            let of = |r: &Replicate| r.values.iter().map(Option::is_some).collect();
            m.replicates.iter().map(of).collect()
        };
        if gaps(made) != gaps(&data) {
            return Err("simulated data have other gaps than the measurements".into());
        }
        // Only one replicate of each data set is used: the others share the common errors with it.
        for (i, value) in made.replicates[0].values.iter().enumerate() {
            squares[i].extend(value.map(|y| (y - truth[i]).powi(2)));
        }
    }
    for (i, squares) in squares.iter().enumerate().filter(|(_, s)| !s.is_empty()) {
        let predicted: f64 = parts.iter().map(|p| p.variance[i]).sum();
        let n = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / n;
        let spread = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n;
        if (mean - predicted).abs() > 5.0 * (spread / n).sqrt() {
            return Err(format!("output {}: predicted {predicted}, simulated {mean}", i + 1));
        }
    }
    Ok(())
}

/// Tests that the likelihood is that of the data which are simulated, by the identities of Bartlett (Biometrika 40 (1953) 12):
/// at the truth the derivative of the log-likelihood by a shift or a stretch of the response has mean zero, and a variance
/// that is minus the mean of the second derivative. A discrepancy whose law follows from the data has none of them and is
/// left out, as is one whose likelihood is an estimate.
pub(super) fn has_the_law_that_it_simulates(discrepancy: &dyn Discrepancy) -> Result<(), String> {
    const COUNT: u64 = 300;
    if discrepancy.stochastic_model() != StochasticModel::Refused {
        return Ok(());
    }
    let (truth, errors) = (truth(), [common("emulator", true)]);
    let build = |data: &Measurements| {
        let built = discrepancy.likelihood(&known(data, &errors));
        built.map_err(|stop| format!("sound data are refused: {stop}"))
    };
    let whole = build(&data())?;
    let start = start(&*whole);
    let law = |likelihood: &dyn Likelihood| -> Vec<Vec<f64>> {
        likelihood.predictive(&truth, &start).into_iter().map(|part| part.variance).collect()
    };
    let fixed = law(&*whole);
    let (mut scores, mut curvatures) = (Vec::new(), Vec::new());
    for k in 0..COUNT {
        let made = whole.simulate(&truth, &start, &Stream::root(14).at(k));
        let [made] = &made[..] else { return Ok(()) };
        let of_made = build(made)?;
        if of_made.hyperparameters().len() != start.len() || law(&*of_made) != fixed {
            return Ok(());
        }
        // Along the response itself, of which every output takes part.
        let along = |stretch: f64| {
            let response: Vec<f64> = truth.iter().map(|y| stretch * y).collect();
            of_made.log_likelihood(&response, &start)
        };
        let (below, here, above) = (along(1.0 - STRETCH), along(1.0), along(1.0 + STRETCH));
        scores.push((above - below) / (2.0 * STRETCH));
        curvatures.push((above - 2.0 * here + below) / (STRETCH * STRETCH));
    }
    let of = |values: &[f64]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let spread = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (spread / n).sqrt())
    };
    let (mean, error) = of(&scores);
    if mean.abs() > 5.0 * error {
        return Err(format!(
            "its likelihood is not that of the data it simulates: along the response its slope has the mean {mean} ± {error} in place \
             of 0"
        ));
    }
    let differences: Vec<f64> = scores.iter().zip(&curvatures).map(|(s, c)| s * s + c).collect();
    let (mean, error) = of(&differences);
    if mean.abs() > 5.0 * error {
        let share = 1.0 + mean / -of(&curvatures).0;
        return Err(format!(
            "its likelihood is not that of the data it simulates: their variance is about {share:.2} times that of the likelihood"
        ));
    }
    Ok(())
}

/// Step of the differences along the response, as a part of it.
const STRETCH: f64 = 1e-3;

pub(super) fn draws_the_errors_it_predicts(likelihood: &dyn Likelihood) -> Result<(), String> {
    const COUNT: u64 = 2000;
    let (truth, start) = (truth(), start(likelihood));
    let parts = likelihood.predictive(&truth, &start);
    let stream = Stream::root(12);
    let mut squares = vec![Vec::new(); parts.len() * OUTPUTS];
    for k in 0..COUNT {
        let paths = likelihood.errors(&truth, &start, &stream.at(k));
        if k == 0 && paths != likelihood.errors(&truth, &start, &stream.at(0)) {
            return Err("the same stream gives other errors".into());
        }
        let same = |(path, part): (&ErrorPath, &VariancePart)| {
            path.origin == part.origin && path.values.len() == OUTPUTS
        };
        if paths.len() != parts.len() || !paths.iter().zip(&parts).all(same) {
            return Err("the errors are not those of the predicted variance, one for each".into());
        }
        let values = paths.iter().flat_map(|path| &path.values);
        squares.iter_mut().zip(values).for_each(|(all, e)| all.push(e * e));
    }
    let predicted = parts.iter().flat_map(|part| &part.variance);
    let largest = predicted.clone().fold(0.0_f64, |most, v| most.max(*v));
    for (i, (squares, predicted)) in squares.iter().zip(predicted).enumerate() {
        let n = COUNT as f64;
        let mean = squares.iter().sum::<f64>() / n;
        let spread = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n;
        if (mean - predicted).abs() > 5.0 * (spread / n).sqrt() + 1e-12 * largest {
            let (origin, output) = (&parts[i / OUTPUTS].origin, i % OUTPUTS + 1);
            return Err(format!(
                "`{origin}`, output {output}: predicted {predicted}, drawn {mean}"
            ));
        }
    }
    Ok(())
}

pub(super) fn draws_errors_given_the_data(likelihood: &dyn Likelihood) -> Result<(), String> {
    let (truth, start) = (truth(), start(likelihood));
    let parts = likelihood.predictive(&truth, &start);
    let draw = |k| likelihood.errors_given_data(&truth, &start, &Stream::root(13).at(k));
    let Some(paths) = draw(0) else { return Ok(()) };
    if draw(0).as_ref() != Some(&paths) {
        return Err("the same stream gives other errors".into());
    }
    let same = |(path, part): (&ErrorPath, &VariancePart)| {
        path.origin == part.origin
            && path.values.len() == OUTPUTS
            && path.values.iter().all(|e| e.is_finite())
    };
    if paths.len() != parts.len() || !paths.iter().zip(&parts).all(same) {
        return Err("the errors are not finite, one for each origin of the variance".into());
    }
    Ok(())
}

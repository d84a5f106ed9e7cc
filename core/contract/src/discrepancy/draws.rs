//! Checks of the data that a discrepancy simulates and of the errors that it draws.

use lacuna::data::{Measurements, Replicate};
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{ErrorPath, Likelihood, VariancePart};

use super::{OUTPUTS, data, start, truth};

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

//! Generated data of a truth: its response with noise, with the layout, replicates and missing values of the
//! measurements.

use lacuna::data::{Measurements, Observations};
use lacuna::math::random::{Stream, below};
use lacuna::plugin::Forward;
use lacuna::run::Stop;

use crate::stage::calibrate::Parts;
use crate::study::Study;

/// Data simulated by the discrepancy around a response.
///
/// A discrepancy may estimate from the data quantities that it does not sample, such as a variance that it integrates
/// out. It is therefore given the study's own data, shifted so that they have the same residuals about this response as
/// about `fitted`.
pub fn of_discrepancy(
    study: &Study,
    forward: &dyn Forward,
    data: &Observations,
    [fitted, response]: [&[f64]; 2],
    hyper: &[f64],
    stream: &Stream,
) -> Result<Observations, Stop> {
    let mut moved = data.clone();
    for (block, range) in moved.blocks.iter_mut().zip(data.layouts().ranges()) {
        let change: Vec<f64> = range.map(|i| response[i] - fitted[i]).collect();
        for replicate in &mut block.replicates {
            for (value, change) in replicate.values.iter_mut().zip(&change) {
                *value = value.map(|y| y + change);
            }
        }
    }
    let parts = Parts::bare(study, &moved, forward)?;
    Ok(Observations { blocks: parts.likelihood().simulate(response, hyper, stream) })
}

/// Smallest number of replicates whose residuals can be reused.
const FEWEST: usize = 3;

/// Data around a response with the residuals of the measurements, those of each replicate with a random sign: the wild
/// bootstrap (Liu, Annals of Statistics 16 (1988) 1696). The residuals are about the mean of the replicates, and
/// enlarged by the square root of n / (n - 1).
///
/// The correlations within a replicate are kept, and so is the shape of the residuals' distribution as far as it is
/// symmetric. Resampling replicates with replacement would give copies, from which a study could not learn the
/// correlation within a replicate.
pub fn of_replicates(
    data: &Observations,
    response: &[f64],
    stream: &Stream,
) -> Result<Observations, Stop> {
    let summaries = data.summaries();
    let few = summaries.iter().position(|s| (1..FEWEST).contains(&s.count));
    if let Some(output) = few {
        let count = summaries[output].count;
        let plural = if count == 1 { "" } else { "s" };
        return Err(Stop::new(format!(
            "the value at {} has {count} replicate{plural}, but reusing residuals needs at least {FEWEST}",
            data.layouts().describe(output)
        ))
        .help("`--noise posterior` takes the noise from the discrepancy"));
    }
    let mut blocks = Vec::new();
    for (k, (block, range)) in data.blocks.iter().zip(data.layouts().ranges()).enumerate() {
        blocks.push(signed(block, &response[range], &stream.at(k as u64)));
    }
    Ok(Observations { blocks })
}

fn signed(data: &Measurements, response: &[f64], stream: &Stream) -> Measurements {
    let summaries = data.summaries();
    let mut made = data.clone();
    for (r, replicate) in made.replicates.iter_mut().enumerate() {
        let is_turned = below(&mut stream.at(r as u64).generator(), 2) == 0;
        let sign = if is_turned { -1.0 } else { 1.0 };
        for (i, value) in replicate.values.iter_mut().enumerate() {
            let count = summaries[i].count as f64;
            let scale = sign * (count / (count - 1.0)).sqrt();
            *value = value.map(|y| response[i] + scale * (y - summaries[i].mean));
        }
    }
    made
}

/// Smallest number of replicates of any measured value.
pub fn fewest(data: &Observations) -> usize {
    let counts = data.summaries().into_iter().map(|s| s.count).filter(|&count| count > 0);
    counts.min().unwrap_or(0)
}

/// Mean variance between replicates over all values with at least two.
pub fn scatter(data: &Observations) -> Option<f64> {
    let all: Vec<f64> = data.summaries().iter().filter_map(|s| Some(s.sd()?.powi(2))).collect();
    (!all.is_empty()).then(|| lacuna::math::moments::mean(&all))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Layout, Replicate, Unit};
    use lacuna::math::moments::mean;
    use lacuna::math::random::normal;

    fn data(replicates: usize) -> Observations {
        let unit = Unit::dimensionless();
        let grid: Vec<f64> = (0..6).map(f64::from).collect();
        let axes = vec![Axis::grid("time", grid, unit.clone())];
        let layout = Layout { name: "y".into(), unit, axes };
        let one = |r: usize| {
            let mut rng = Stream::root(3).at(r as u64).generator();
            let gain = normal(&mut rng);
            let gap = |i: usize| (i == 5 && r.is_multiple_of(2)).then_some(());
            let values =
                (0..6).map(|i| gap(i).map_or(Some(5.0 + gain * (i + 1) as f64), |()| None));
            Replicate::new(r.to_string(), values.collect())
        };
        Measurements::new(layout, (0..replicates).map(one).collect()).into()
    }

    /// Curves that differ by one random factor: the generated ones do too, so that all their values are proportional,
    /// and have the same missing values. The mean of n replicates has, by definition, their variance divided by n.
    #[test]
    fn residuals_keep_their_correlation_their_variance_and_the_gaps() {
        let data = data(12);
        let response = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut means = Vec::new();
        for k in 0..500 {
            let made = of_replicates(&data, &response, &Stream::root(9).at(k)).unwrap();
            for (new, old) in made.blocks[0].replicates.iter().zip(&data.blocks[0].replicates) {
                let gaps = |r: &Replicate| r.values.iter().map(Option::is_none).collect::<Vec<_>>();
                assert_eq!(gaps(new), gaps(old));
                let [a, b] = [0, 1].map(|i| new.values[i].unwrap() - response[i]);
                assert!((b - 2.0 * a).abs() < 1e-12);
            }
            means.push(made.summaries()[0].mean - response[0]);
        }
        let expected = data.summaries()[0].sd().unwrap().powi(2) / 12.0;
        let squares: Vec<f64> = means.iter().map(|m| m * m).collect();
        // Relative error of the mean square of 500 numbers whose distribution is no wider than a normal one.
        let found = mean(&squares);
        assert!(
            (found / expected - 1.0).abs() < 4.0 * (2.0 / 500.0_f64).sqrt(),
            "{found} {expected}"
        );
        assert!(mean(&means).abs() < 4.0 * (expected / 500.0).sqrt());
    }

    #[test]
    fn two_replicates_have_no_residuals_to_take_again() {
        let stop = of_replicates(&data(2), &[0.0; 6], &Stream::root(1)).unwrap_err();
        assert!(stop.message.contains("needs at least"), "{stop}");
    }
}

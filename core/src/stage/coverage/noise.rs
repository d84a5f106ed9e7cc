//! Data of a truth: its response with noise, on the layout and with the replicates and gaps of the measurements.

use crate::data::{Measurements, Observations, Replicate};
use crate::math::random::{Stream, below};
use crate::plugin::Forward;
use crate::run::Stop;
use crate::stage::calibrate::Parts;
use crate::study::Study;

/// Data as the discrepancy makes them about a response.
///
/// A discrepancy may take from the data what it does not sample, such as a variance that it integrates out. It is
/// given the study's own data with the same residuals about this response as they have about `fitted`.
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

/// Fewer replicates than this have no residuals that could be drawn again.
const FEWEST: usize = 3;

/// Data about a response with residuals of the measurements: for each replicate those of one drawn at random among all that
/// measured what it did. They are about the mean of the replicates, and larger by the root of n / (n - 1).
pub fn of_replicates(
    data: &Observations,
    response: &[f64],
    stream: &Stream,
) -> Result<Observations, Stop> {
    let mut blocks = Vec::new();
    for (k, (block, range)) in data.blocks.iter().zip(data.layouts().ranges()).enumerate() {
        blocks.push(redrawn(block, &response[range], &stream.at(k as u64))?);
    }
    Ok(Observations { blocks })
}

fn redrawn(data: &Measurements, response: &[f64], stream: &Stream) -> Result<Measurements, Stop> {
    let summaries = data.summaries();
    let mut made = data.clone();
    for (r, replicate) in made.replicates.iter_mut().enumerate() {
        if replicate.values.iter().all(Option::is_none) {
            continue;
        }
        let donors: Vec<&Replicate> =
            data.replicates.iter().filter(|donor| covers(donor, &data.replicates[r])).collect();
        if donors.len() < FEWEST {
            return Err(Stop::new(format!(
                "{} replicates measured what `{}` did, and {FEWEST} are the fewest whose residuals can be drawn again",
                donors.len(),
                replicate.name
            ))
            .help("`--noise posterior` takes the noise from the discrepancy"));
        }
        let donor = donors[below(&mut stream.at(r as u64).generator(), donors.len())];
        for (i, value) in replicate.values.iter_mut().enumerate() {
            let count = summaries[i].count as f64;
            let scale = (count / (count - 1.0)).sqrt();
            *value =
                value.and(donor.values[i]).map(|y| response[i] + scale * (y - summaries[i].mean));
        }
    }
    Ok(made)
}

/// Whether one measured all that another did.
fn covers(donor: &Replicate, replicate: &Replicate) -> bool {
    let pairs = donor.values.iter().zip(&replicate.values);
    pairs.into_iter().all(|(donor, value)| value.is_none() || donor.is_some())
}

/// The fewest replicates of any measured value.
pub fn fewest(data: &Observations) -> usize {
    let counts = data.summaries().into_iter().map(|s| s.count).filter(|&count| count > 0);
    counts.min().unwrap_or(0)
}

/// The mean variance between replicates over all values that have two.
pub fn scatter(data: &Observations) -> Option<f64> {
    let all: Vec<f64> = data.summaries().iter().filter_map(|s| Some(s.sd()?.powi(2))).collect();
    (!all.is_empty()).then(|| crate::math::moments::mean(&all))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Axis, Layout, Unit};
    use crate::math::moments::{mean, variance};
    use crate::math::random::normal;

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

    /// Curves that differ by one random factor: curves drawn again differ by it too, so that all their values are
    /// proportional, have the variance of the replicates, and the gaps that were there.
    #[test]
    fn residuals_keep_their_correlation_their_variance_and_the_gaps() {
        let data = data(12);
        let response = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut first = Vec::new();
        for k in 0..500 {
            let made = of_replicates(&data, &response, &Stream::root(9).at(k)).unwrap();
            for (new, old) in made.blocks[0].replicates.iter().zip(&data.blocks[0].replicates) {
                let gaps = |r: &Replicate| r.values.iter().map(Option::is_none).collect::<Vec<_>>();
                assert_eq!(gaps(new), gaps(old));
                let [a, b] = [0, 1].map(|i| new.values[i].unwrap() - response[i]);
                assert!((b - 2.0 * a).abs() < 1e-12);
            }
            first.push(made.blocks[0].replicates[0].values[0].unwrap() - 1.0);
        }
        let expected = data.summaries()[0].sd().unwrap().powi(2);
        let found = variance(&first);
        // The relative error of a variance of 500 numbers, allowing for twice the kurtosis of a normal law.
        assert!(
            (found / expected - 1.0).abs() < 4.0 * (4.0 / 500.0_f64).sqrt(),
            "{found} {expected}"
        );
        assert!(mean(&first).abs() < 4.0 * (expected / 500.0).sqrt());
    }

    #[test]
    fn two_replicates_have_no_residuals_to_draw() {
        let stop = of_replicates(&data(2), &[0.0; 6], &Stream::root(1)).unwrap_err();
        assert!(stop.message.contains("the fewest"), "{stop}");
    }
}

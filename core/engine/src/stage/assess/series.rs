//! Autocorrelation of the residuals of curves.

use lacuna::data::{Coordinates, Measurements};

/// Length below which a curve's autocorrelation cannot be estimated.
const SHORT: usize = 10;

/// Number of values up to which all series are held; longer ones are made again for each lag.
const HELD: usize = 1_000_000;

/// Gives the residuals of each contiguous stretch of a curve, in standard deviations, to `each`.
pub(super) fn of(
    block: &Measurements,
    response: &[f64],
    variance: &[f64],
    each: &mut dyn FnMut(&[f64]),
) {
    let Some(last) = block.layout.axes.last() else { return };
    if !matches!(last.coordinates, Coordinates::Grid { .. }) || last.len() < SHORT {
        return;
    }
    let sd: Vec<f64> = variance.iter().map(|v| v.sqrt()).collect();
    let mut stretch = Vec::with_capacity(last.len());
    for replicate in &block.replicates {
        let residual = |(((y, r), v), sd): (((&Option<f64>, &f64), &f64), &f64)| {
            y.filter(|_| *v > 0.0).map(|y| (y - r) / sd)
        };
        let values = replicate.values.iter().zip(response).zip(variance).zip(&sd);
        for (place, residual) in values.map(residual).enumerate() {
            if place % last.len() == 0 || residual.is_none() {
                give(&mut stretch, each);
            }
            stretch.extend(residual);
        }
        give(&mut stretch, each);
    }
}

/// Gives a stretch that is long enough, and begins the next.
fn give(stretch: &mut Vec<f64>, each: &mut dyn FnMut(&[f64])) {
    if stretch.len() >= SHORT {
        each(stretch);
    }
    stretch.clear();
}

/// Integrated autocorrelation time about zero of the series that `visit` gives, summed over Sokal's window.
pub(super) fn time(visit: impl Fn(&mut dyn FnMut(&[f64]))) -> Option<f64> {
    let (mut longest, mut held, mut values) = (0, Vec::new(), 0);
    visit(&mut |series| {
        longest = longest.max(series.len());
        values += series.len();
        if values <= HELD {
            held.push(series.to_vec());
        }
    });
    if values <= HELD {
        return integrated(longest, |each| held.iter().for_each(|series| each(series)));
    }
    drop(held);
    integrated(longest, visit)
}

fn integrated(longest: usize, visit: impl Fn(&mut dyn FnMut(&[f64]))) -> Option<f64> {
    const WINDOW: f64 = 5.0;
    let lagged = |lag: usize| {
        let (mut sum, mut count) = (0.0, 0.0);
        visit(&mut |series| {
            if series.len() > lag {
                sum += lacuna_linalg::vector::dot(&series[..series.len() - lag], &series[lag..]);
                count += (series.len() - lag) as f64;
            }
        });
        if count > 0.0 { sum / count } else { 0.0 }
    };
    let power = lagged(0);
    if power <= 0.0 || !power.is_finite() {
        return None;
    }
    let mut time = 1.0;
    for lag in 1..longest {
        time += 2.0 * lagged(lag) / power;
        if lag as f64 >= WINDOW * time {
            break;
        }
    }
    Some(time.max(0.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Layout, Replicate, Unit};

    #[test]
    fn a_series_ends_with_its_curve_and_at_a_gap() {
        let grid: Vec<f64> = (0..25).map(f64::from).collect();
        let layout = Layout {
            name: "y".into(),
            unit: Unit::dimensionless(),
            axes: vec![
                Axis::labels("sensor", ["A", "B"]),
                Axis::grid("time", grid, Unit::parse("s").unwrap()),
            ],
        };
        // A gap leaves twelve values of the first curve on each side, and one of the second leaves five that are too few.
        let value = |i: usize| (i != 12 && i != 30).then_some(i as f64);
        let replicate = Replicate::new("p", (0..50).map(value).collect());
        let block = Measurements::new(layout, vec![replicate]);
        let mut found = Vec::new();
        of(&block, &[0.0; 50], &[4.0; 50], &mut |series| found.push(series.to_vec()));
        let halves =
            |range: std::ops::Range<usize>| -> Vec<f64> { range.map(|i| i as f64 / 2.0).collect() };
        assert_eq!(found, [halves(0..12), halves(13..25), halves(31..50)]);
    }

    /// A wave of many periods has the autocorrelation of a cosine whether it is held or not.
    #[test]
    fn series_that_are_not_held_have_the_same_time() {
        let wave: Vec<f64> = (0..1000).map(|i| (0.7 * f64::from(i)).sin()).collect();
        let held = time(|each| each(&wave));
        let again = integrated(wave.len(), |each| each(&wave));
        assert!(held.is_some() && held == again);
        let many = time(|each| (0..1001).for_each(|_| each(&wave)));
        assert!((many.unwrap() - held.unwrap()).abs() < 1e-9);
    }
}

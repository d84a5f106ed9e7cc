//! The interval of the share closed, in closed form.
#![allow(clippy::unwrap_used)]

use lacuna::math::random::{Stream, normal};

use super::*;

/// Three replicates of 200 values; the gap before is 0.5 or 0.2 standard deviations, of which 96 and 75 % close. The
/// interval holds the truth in 95 % of 2000 draws at least, by Monte Carlo to 1.5 % (three standard errors), and in
/// no more than 99 %: the moderated variance is exact here, and the quantile of Student's t is wider than it needs.
#[test]
fn fiellers_interval_holds_the_true_share() {
    for (gap, left) in [(0.5, 0.1), (0.2, 0.1)] {
        let (count, values, draws) = (3, 200, 2000);
        let truth = 1.0 - left * left / (gap * gap);
        let (mut held, mut without) = (0, 0);
        for draw in 0..draws {
            let mut rng = Stream::root(7).at(draw).generator();
            let own: Vec<Misfits> = (0..count)
                .map(|_| {
                    let z: Vec<f64> = (0..values).map(|_| normal(&mut rng)).collect();
                    let square = |shift: f64| z.iter().map(|z| (z + shift).powi(2)).sum();
                    let change = f64::from(values) * (gap - left) * (gap - left);
                    let values = f64::from(values);
                    Misfits { before: square(gap), after: square(left), change, known: 0.0, values }
                })
                .collect();
            let found = Comparison::of(&[own], 0.0).unwrap();
            held += u32::from(found.lower <= truth && truth <= found.upper);
            without += u32::from(found.lower.is_infinite());
        }
        let share = f64::from(held) / draws as f64;
        assert!((0.935..0.99).contains(&share), "{share} of gap {gap}, {without} without");
    }
}

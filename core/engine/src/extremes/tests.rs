use std::f64::consts::PI;

use super::*;

type Function<'a> = &'a (dyn Fn(&[f64]) -> f64 + Sync);

fn found(dimension: usize, points: usize, functions: &[Function<'_>]) -> Extremes {
    let plan = Plan { dimension, followed: (0..functions.len()).collect(), points };
    let evaluate = |points: &Matrix| {
        Matrix::from_fn(points.rows(), functions.len(), |i, k| functions[k](points.row(i)))
    };
    extremes(&plan, &Stream::root(7), &evaluate)
}

fn values(found: &[Option<Extreme>]) -> Vec<f64> {
    found.iter().map(|extreme| extreme.unwrap().value).collect()
}

/// Branin's function on [-5, 10] x [0, 15] and the six-hump camel function on [-2, 2] x [-1, 1] (Dixon and Szegö, Towards
/// Global Optimisation 2 (1978)): minima 0.397887 and -1.031628, each in several places.
#[test]
fn published_minima_are_found_by_both_searches() {
    let branin = |u: &[f64]| {
        let (x, y) = (15.0 * u[0] - 5.0, 15.0 * u[1]);
        let inner = y - 5.1 / (4.0 * PI * PI) * x * x + 5.0 / PI * x - 6.0;
        inner * inner + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * x.cos() + 10.0
    };
    let camel = |u: &[f64]| {
        let (x, y) = (4.0 * u[0] - 2.0, 2.0 * u[1] - 1.0);
        (4.0 - 2.1 * x * x + x.powi(4) / 3.0) * x * x + x * y + (4.0 * y * y - 4.0) * y * y
    };
    let all = found(2, 600, &[&branin, &camel]);
    let lowest = values(&all.lowest);
    assert!((lowest[0] - 0.397_887).abs() < 0.02, "{lowest:?}");
    assert!((lowest[1] + 1.031_628).abs() < 0.002, "{lowest:?}");
    // The largest value of Branin's function is at the corner (-5, 0), that of the other at two corners.
    let highest = all.highest[0].unwrap();
    assert_eq!((highest.value, &all.points[highest.row]), (branin(&[0.0, 0.0]), &vec![0.0, 0.0]));
    assert_eq!(all.highest[1].unwrap().value, camel(&[0.0, 0.0]));
    let differences = all.lowest.iter().chain(&all.highest).map(|e| e.unwrap().difference);
    assert!(differences.into_iter().all(|d| (0.0..0.05).contains(&d)), "{all:?}");
    assert!(all.points.len() <= 600 && all.points.len() == all.values.len());
}

/// A summit inside, one on an edge, and a slope towards a corner, in five dimensions.
#[test]
fn smooth_functions_of_five_inputs() {
    let summit = |u: &[f64]| -u.iter().map(|x| (x - 0.3).powi(2)).sum::<f64>();
    let edge = |u: &[f64]| u[0] - (u[1] - 0.6).powi(2) - (u[2] - 0.5).powi(4);
    let line = |u: &[f64]| u[0] - 2.0 * u[1] + 3.0 * u[2] - 4.0 * u[3] + 5.0 * u[4];
    let all = found(5, 1500, &[&summit, &edge, &line]);
    let highest = values(&all.highest);
    assert!(highest[0] > -1e-5 && highest[1] > 1.0 - 1e-5 && highest[2] == 9.0, "{highest:?}");
    assert_eq!(values(&all.lowest)[2], -6.0);
    assert!((values(&all.lowest)[0] + 5.0 * 0.49).abs() < 1e-12);
    assert!(!all.exhausted);
}

/// A needle in a corner is found, and that both searches missed it is told. A needle inside is not found: nothing can be told.
#[test]
fn a_needle_in_a_corner_is_told() {
    let needle = |u: &[f64]| (-u.iter().map(|x| (1.0 - x).powi(2)).sum::<f64>() / 1e-7).exp();
    let all = found(3, 200, &[&needle]);
    let highest = all.highest[0].unwrap();
    assert_eq!(highest.value, 1.0);
    assert!(highest.difference > 0.999, "{highest:?}");
}

/// A function that is undefined on one half, one that is defined nowhere, and one that does not vary.
#[test]
fn undefined_and_constant_functions() {
    let half = |u: &[f64]| if u[0] < 0.5 { f64::NAN } else { (u[0] - 0.7).powi(2) };
    let all = found(1, 100, &[&half, &|_| f64::NAN, &|_| 3.5]);
    assert!(all.lowest[0].unwrap().value < 1e-9);
    assert!((all.highest[0].unwrap().value - 0.09).abs() < 1e-12);
    assert!(all.lowest[1].is_none() && all.highest[1].is_none());
    assert_eq!(all.lowest[2].map(|e| (e.value, e.difference)), Some((3.5, 0.0)));
}

#[test]
fn a_search_without_room_says_so() {
    let bent = |u: &[f64]| (20.0 * u[0]).sin() + (17.0 * u[1]).cos() * u[2];
    let all = found(3, 40, &[&bent]);
    assert!(all.exhausted && all.points.len() <= 40, "{}", all.points.len());
    assert_eq!(all, found(3, 40, &[&bent]));
}

//! Choice of runs, regression and serialisation by themselves; the combination with surrogates is tested in
//! tests/fidelity.rs.

use lacuna::data::{Parameter, Unit};
use lacuna::math::distribution::Distribution;

use super::rule::Regression;
use super::*;

fn parameter(design: Distribution) -> Parameter {
    Parameter {
        name: "x".into(),
        symbol: "x".into(),
        unit: Unit::dimensionless(),
        prior: design.clone(),
        design,
        reference: None,
    }
}

/// On a grid of eleven points from 0 to 1 the point with the smallest mean squared distance from all others is the
/// middle; a second and a third one lie on either side of it. The order of the points does not matter.
#[test]
fn runs_are_chosen_evenly() {
    let parameters = [parameter(Distribution::Uniform([0.0, 10.0]))];
    for reversed in [false, true] {
        let place = |i: usize| if reversed { 10 - i } else { i };
        let points = Matrix::from_fn(11, 1, |i, _| place(i) as f64);
        let coverage = Coverage::new(&parameters, &points);
        let all: Vec<usize> = (0..11).collect();
        let mut chosen: Vec<usize> = cover(&coverage, &all, 3).into_iter().map(place).collect();
        assert_eq!(chosen[0], 5);
        chosen.sort_unstable();
        assert!((1..=2).contains(&chosen[0]) && (8..=9).contains(&chosen[2]), "{chosen:?}");
        assert_eq!(cover(&coverage, &all, 30), all);
    }
}

/// A chosen set covers the runs better than the first ones do: the mean squared distance to the nearest is lower.
#[test]
fn chosen_runs_are_nearer_to_all_than_the_first() {
    let parameters = [
        parameter(Distribution::Uniform([0.0, 1.0])),
        parameter(Distribution::Uniform([0.0, 1.0])),
    ];
    let mut rng = lacuna::math::random::Stream::root(4).generator();
    let points = Matrix::from_fn(200, 2, |_, _| lacuna::math::random::uniform(&mut rng));
    let all: Vec<usize> = (0..200).collect();
    let chosen = cover(&Coverage::new(&parameters, &points), &all, 10);
    let distance = |set: &[usize]| {
        let nearest = |i: usize| {
            let square =
                |&c: &usize| (0..2).map(|j| (points[(i, j)] - points[(c, j)]).powi(2)).sum::<f64>();
            set.iter().map(square).fold(f64::INFINITY, f64::min)
        };
        all.iter().map(|&i| nearest(i)).sum::<f64>()
    };
    assert!(distance(&chosen) < 0.6 * distance(&all[..10]));
}

/// `y = 3 c + 2 - 5 x`: with linear functions removed the factor is 3, whatever the line; a response that is constant
/// apart from the line has the factor one.
#[test]
fn the_factor_does_not_see_lines() {
    let points = Matrix::from_fn(6, 1, |i, _| i as f64);
    let cheap = Matrix::from_fn(6, 1, |i, _| (i as f64).sin());
    let fine = Matrix::from_fn(6, 1, |i, _| 3.0 * cheap[(i, 0)] + 2.0 - 5.0 * i as f64);
    let regression = Regression::new(&points, true);
    assert!((regression.factor(&fine, &cheap, &[0]) - 3.0).abs() < 1e-12);
    assert_eq!(regression.factor(&fine, &points, &[0]), 1.0);
    let plain = Regression::new(&points, false).factor(&fine, &cheap, &[0]);
    assert!((plain - 3.0).abs() > 0.1);
}

/// Written data read back; truncated or foreign bytes are rejected.
#[test]
fn bytes_read_back() {
    let verdict = Verdict {
        group: "A".into(),
        rule: Rule::BOTH,
        scale: 1.1,
        left_out: vec![(Rule::SAME, Some(0.1 + 0.2)), (Rule::BOTH, None)],
    };
    let difference = Difference {
        scale: vec![1.1, 0.1 + 0.2],
        offset: vec![0.0, -1e-300],
        emulated: vec![true, false],
        emulator: Some(vec![1, 2, 3]),
        residuals: Matrix::from_fn(3, 2, |i, j| (i as f64 + 0.1) / (j as f64 + 3.0)),
        relative: vec![0.5, 0.0],
        verdicts: vec![verdict],
    };
    let bytes = difference.to_bytes().unwrap();
    assert_eq!(Difference::from_bytes(&bytes).unwrap(), difference);
    for length in 0..bytes.len() {
        assert!(Difference::from_bytes(&bytes[..length]).is_err());
    }
    assert_eq!(split(&joined(b"first", b"second")).unwrap(), (&b"first"[..], &b"second"[..]));
}

//! Paths of least-angle regression through several sets of terms, compared with the explicit path on each.

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::{Matrix, multiply_vector};

use super::bench::latin_hypercube;
use super::textbook::{Rows, basis, slow_path};
use crate::surrogates::polynomial_chaos::dictionary::Dictionary;
use crate::surrogates::polynomial_chaos::judge::{Criterion, Path, best_along};
use crate::surrogates::polynomial_chaos::least_angle::LeastAngle;

/// Exponents of total degree at most 9 in three parameters, lower degrees first.
fn exponents() -> Vec<Vec<u16>> {
    (0..10_u16)
        .flat_map(|p| (0..=p).flat_map(move |j| (0..=j).map(move |k| vec![p - j, j - k, k])))
        .collect()
}

/// Returns the members of degree `p` in a norm.
fn members(exponents: &[Vec<u16>], p: u16, norm: f64) -> Vec<usize> {
    let size = |e: &[u16]| e.iter().map(|&e| f64::from(e).powf(norm)).sum::<f64>();
    let bound = f64::from(p).powf(norm) * (1.0 + 1e-12);
    (0..exponents.len()).filter(|&t| size(&exponents[t]) <= bound).collect()
}

/// Follows the paths on all sets, each from the one before, and returns how many of their first terms each took over.
fn follow(exponents: &[Vec<u16>], sets: &[Vec<usize>], decay: f64, seed: u64) -> Vec<usize> {
    let runs = 150;
    let unit = latin_hypercube(runs, 3, 9);
    let psi = basis(exponents, &unit);
    // All inner products at once, or those of the active terms.
    let whole = seed.is_multiple_of(2);
    let dictionary = Dictionary::new(&Matrix::from_rows(exponents.len(), &psi), None, whole);
    let mut rng = Stream::root(seed).generator();
    let size = |e: &Vec<u16>| (-decay * f64::from(e.iter().sum::<u16>())).exp();
    let weights: Vec<f64> = exponents.iter().map(|e| size(e) * normal(&mut rng)).collect();
    let y: Vec<f64> =
        psi.iter().map(|row| row.iter().zip(&weights).map(|(p, w)| p * w).sum()).collect();
    let mean = y.iter().sum::<f64>() / runs as f64;
    let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
    let correlations = multiply_vector(dictionary.columns(), &centred);
    let subsets: Vec<_> = sets.iter().map(|members| dictionary.subset(members)).collect();
    let mut path: Option<LeastAngle<'_>> = None;
    let mut shared = Vec::new();
    for (members, subset) in sets.iter().zip(&subsets) {
        let next = match path.take() {
            Some(before) => before.among(subset),
            None => LeastAngle::new(&dictionary, subset, &correlations),
        };
        let own = path.insert(next);
        shared.push(own.active().terms().len());
        let most = subset.count().min(runs - 2);
        let choice = best_along(own, &centred, &Criterion::LeaveOneOut, most, 20);
        let terms = choice.map(|c| c.terms).unwrap_or_default();
        let columns: Rows =
            psi.iter().map(|row| members.iter().map(|&t| row[t]).collect()).collect();
        let slow = slow_path(&columns, &y, terms.len());
        let expected: Vec<usize> = slow.into_iter().map(|i| members[i]).collect();
        assert_eq!(terms, expected, "seed {seed}, {} terms", members.len());
        // What was taken over is also judged: the choice is that of a path of its own.
        let mut alone = LeastAngle::new(&dictionary, subset, &correlations);
        let again = best_along(&mut alone, &centred, &Criterion::LeaveOneOut, most, 20);
        let again = again.map(|c| c.terms).unwrap_or_default();
        assert_eq!(terms, again, "seed {seed}, {} terms", members.len());
    }
    shared
}

#[test]
fn paths_among_more_terms_begin_with_what_they_share() {
    let exponents = exponents();
    let sets: Vec<Vec<usize>> = (1..10).map(|p| members(&exponents, p, 1.0)).collect();
    for seed in 0..4 {
        let shared = follow(&exponents, &sets, 1.2, seed);
        assert!(shared.iter().sum::<usize>() > 60, "{shared:?}");
        // Without decay the further terms enter early.
        let early = follow(&exponents, &sets, 0.0, seed);
        assert!(2 * early.iter().sum::<usize>() < shared.iter().sum(), "{early:?} {shared:?}");
    }
}

/// On runs at three levels of each parameter the functions of degree three and above repeat those below, so that the level
/// meets candidates that do not enter.
#[test]
fn candidates_that_repeat_others_are_shared_as_well() {
    let exponents = exponents();
    let unit = Matrix::from_fn(27, 3, |i, j| (i / 3_usize.pow(j as u32) % 3) as f64 / 2.0);
    let psi = basis(&exponents, &unit);
    let dictionary = Dictionary::new(&Matrix::from_rows(exponents.len(), &psi), None, true);
    let mut rng = Stream::root(3).generator();
    let y: Vec<f64> = (0..27).map(|_| normal(&mut rng)).collect();
    let mean = y.iter().sum::<f64>() / 27.0;
    let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
    let correlations = multiply_vector(dictionary.columns(), &centred);
    let subsets: Vec<_> =
        (1..10).map(|p| dictionary.subset(&members(&exponents, p, 1.0))).collect();
    let mut before = LeastAngle::new(&dictionary, &subsets[0], &correlations);
    for subset in &subsets {
        let error = |path: &mut LeastAngle<'_>| {
            let choice = best_along(path, &centred, &Criterion::LeaveOneOut, 20, usize::MAX);
            (choice.as_ref().map(|c| c.terms.len()), choice.map(|c| c.error))
        };
        before = before.among(subset);
        let (count, shared) = error(&mut before);
        let (alone, own) = error(&mut LeastAngle::new(&dictionary, subset, &correlations));
        // Functions that repeat each other may take each other's place; the fit is the same.
        assert_eq!(count, alone);
        let (shared, own) = (shared.unwrap(), own.unwrap());
        assert!((shared / own - 1.0).abs() < 1e-9, "{shared} {own}");
    }
}

#[test]
fn sets_need_not_contain_each_other() {
    let exponents = exponents();
    let of_degree = |p| [members(&exponents, p, 0.5), members(&exponents, p, 1.0)];
    let sets: Vec<Vec<usize>> = (1..10).flat_map(of_degree).collect();
    for seed in 0..3 {
        let shared = follow(&exponents, &sets, 0.8, seed);
        assert!(shared.iter().sum::<usize>() > 20, "{shared:?}");
    }
}

#![allow(clippy::unwrap_used)]
use std::f64::consts::PI;

use lacuna::math::random::{Stream, below, normal, permutation, uniform};
use lacuna_linalg::Matrix;

use super::criterion::dependences;
use super::{ElementaryEffects, LEVEL, Screening, active_subspace, few_outputs, screen};

fn cube(runs: usize, inputs: usize, stream: &Stream) -> Matrix {
    let mut rng = stream.generator();
    Matrix::from_fn(runs, inputs, |_, _| uniform(&mut rng))
}

/// Trajectories of Morris (1991) on four levels of the closed cube: one input after the other changes by 2/3.
fn trajectories(count: usize, inputs: usize, stream: &Stream) -> Matrix {
    let mut rng = stream.generator();
    let mut points = Matrix::zeros(0, inputs);
    for _ in 0..count {
        let mut point: Vec<f64> = (0..inputs).map(|_| below(&mut rng, 4) as f64 / 3.0).collect();
        points.push_row(&point);
        for j in permutation(&mut rng, inputs) {
            point[j] += if point[j] > 0.5 { -2.0 / 3.0 } else { 2.0 / 3.0 };
            points.push_row(&point);
        }
    }
    points
}

fn values(points: &Matrix, function: impl Fn(&[f64]) -> f64) -> Matrix {
    Matrix::from_rows(1, points.iter_rows().map(|x| [function(x)]))
}

fn screened(points: &Matrix, responses: &Matrix) -> Screening {
    screen(points, responses, std::iter::once(0..responses.columns())).unwrap()
}

fn effects(points: &Matrix, responses: &Matrix) -> Vec<ElementaryEffects> {
    match screened(points, responses) {
        Screening::Effects(all) => all,
        Screening::Dependence(_) => panic!("trajectories give elementary effects"),
    }
}

/// Index and p-value of three pairs of variables, computed in Python with `NumPy` and `SciPy` from the matrices `K`, `L`
/// and `H` and the formulas of `hsicTestGamma.m` of Gretton et al. (2008).
#[test]
fn the_criterion_is_that_of_its_definition() {
    let x: Vec<f64> = (0..20).map(|i| (f64::from(7 * i % 20) + 0.5) / 20.0).collect();
    let y = |i: usize, pair: usize| match pair {
        0 => (x[i] - 0.5).powi(2) + 0.05 * (3.0 * i as f64).sin(),
        1 => (5.0 * (i * i) as f64).sin(),
        _ => x[i] + 0.5 * (2.0 * i as f64).cos(),
    };
    let expected = [
        (0.381_528_166_354_867, 0.001_275_749_907_897_13),
        (0.112_215_964_128_96, 0.707_629_216_031_818),
        (0.357_851_233_923_622, 0.007_399_138_775_991_95),
    ];
    for (pair, (index, p)) in expected.into_iter().enumerate() {
        let responses = Matrix::from_fn(20, 1, |i, _| y(i, pair));
        let points = Matrix::from_vec(20, 1, x.clone());
        let Screening::Dependence(found) = screened(&points, &responses) else { panic!() };
        assert!((found[0].index - index).abs() < 1e-10, "{pair}: {:?}", found[0]);
        assert!((found[0].p - p).abs() < 1e-9, "{pair}: {:?}", found[0]);
    }
}

/// Inputs without effect have a p-value below a level as often as the level says, within four standard errors of the
/// count.
#[test]
fn independent_inputs_are_seldom_called_dependent() {
    let (sets, inputs) = (30, 10);
    let mut below = 0;
    for set in 0..sets {
        let points = cube(60, inputs, &Stream::root(set).named("inputs"));
        let mut rng = Stream::root(set).named("response").generator();
        let y = Matrix::from_fn(60, 1, |_, _| uniform(&mut rng).ln());
        let mean = y.as_slice().iter().sum::<f64>() / 60.0;
        let variance = y.as_slice().iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 60.0;
        let scaled = Matrix::from_fn(60, 1, |i, _| (y[(i, 0)] - mean) / variance.sqrt());
        below += dependences(&points, &scaled).iter().filter(|d| d.p < LEVEL).count();
    }
    // Inputs of one set share the response, which makes their p-values no less independent of each other.
    let count = sets as f64 * inputs as f64;
    let error = (count * LEVEL * (1.0 - LEVEL)).sqrt();
    assert!((below as f64 - count * LEVEL).abs() < 4.0 * error, "{below} of {count}");
}

/// The function of Ishigami and Homma (1990), in which the third input has no first-order index, with two inputs that
/// do nothing.
#[test]
fn the_inputs_of_ishigamis_function_act() {
    let points = cube(400, 5, &Stream::root(3));
    let responses = values(&points, |u| {
        let x: Vec<f64> = u.iter().map(|u| PI * (2.0 * u - 1.0)).collect();
        x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
    });
    assert_eq!(screened(&points, &responses).acts(), [true, true, true, false, false]);
}

/// A linear function has the elementary effect `c`, and a product `c_ij` the effect `c_ij x_j`, whose mean over the
/// four levels is `c_ij / 2` and whose standard deviation is that of the levels. Effects are in standard deviations
/// of the response.
#[test]
fn elementary_effects_have_their_closed_form() {
    let points = trajectories(400, 3, &Stream::root(4));
    let responses = values(&points, |x| 2.0 * x[0] + 4.0 * x[1] * x[2]);
    let mean = responses.as_slice().iter().sum::<f64>() / responses.rows() as f64;
    let variance = responses.as_slice().iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    let sd = (variance / responses.rows() as f64).sqrt();
    let found = effects(&points, &responses);
    // Where two trajectories meet, they may differ in a single input too.
    assert!(found.iter().all(|e| (400..440).contains(&e.count)), "{found:?}");
    let exact = (found[0].mean_absolute * sd - 2.0).abs() < 1e-9 && found[0].sd < 1e-6;
    assert!(exact, "{:?} {sd}", found[0]);
    // Levels 0, 1/3, 2/3, 1 with equal probability: mean 1/2 and variance 5/36.
    let spread = 4.0 * (5.0_f64 / 36.0).sqrt();
    for effects in &found[1..] {
        let error = spread / 20.0;
        assert!((effects.mean_absolute * sd - 2.0).abs() < 4.0 * error, "{effects:?}");
        assert!((effects.sd * sd / spread - 1.0).abs() < 0.1, "{effects:?}");
    }
}

/// The function of Morris (1991): its first ten inputs act, and the others hardly do. The coefficients that the paper
/// draws at random are those of Saltelli et al., *Global Sensitivity Analysis: The Primer* (2008).
#[test]
fn the_first_ten_inputs_of_morris_act() {
    let points = trajectories(10, 20, &Stream::root(5));
    let responses = values(&points, |x| {
        let w: Vec<f64> = (0..20)
            .map(|i| match i {
                2 | 4 | 6 => 2.0 * (1.1 * x[i] / (x[i] + 0.1) - 0.5),
                _ => 2.0 * (x[i] - 0.5),
            })
            .collect();
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut sum = 5.0 * w[0] * w[1] * w[2] * w[3];
        for i in 0..20 {
            sum += if i < 10 { 20.0 } else { sign(i + 1) } * w[i];
            for j in i + 1..20 {
                sum += if j < 6 { -15.0 } else { sign(i + j) } * w[i] * w[j];
                sum -= (j + 1..5).map(|k| 10.0 * w[i] * w[j] * w[k]).sum::<f64>();
            }
        }
        sum
    });
    let found = effects(&points, &responses);
    let least = found[..10].iter().map(|e| e.mean_absolute).fold(f64::INFINITY, f64::min);
    let most = found[10..].iter().map(|e| e.mean_absolute).fold(0.0, f64::max);
    assert!(least > 2.0 * most, "{least} {most}");
    // Inputs 8 to 10 act linearly, up to the weak interactions: Morris's figure 1 has them at small sigma.
    let ratio = |e: &ElementaryEffects| e.sd / e.mean_absolute;
    assert!(found[7..10].iter().all(|e| ratio(e) < 0.3), "{found:?}");
    assert!(found[..6].iter().all(|e| ratio(e) > 0.3), "{found:?}");
}

#[test]
fn what_cannot_be_screened_has_no_result() {
    let points = cube(50, 2, &Stream::root(6));
    assert!(screen(&points, &Matrix::zeros(50, 3), std::iter::once(0..3)).is_none());
    let few = cube(10, 2, &Stream::root(7));
    assert!(screen(&few, &values(&few, |x| x[0]), std::iter::once(0..1)).is_none());
    // An input that the runs do not vary depends on nothing.
    let still = Matrix::from_fn(50, 2, |i, j| if j == 0 { points[(i, 0)] } else { 0.5 });
    let found = screened(&still, &values(&points, |x| x[0]));
    assert_eq!(found.acts(), [true, false]);
}

/// The gradient of a sine of `w'x` is a multiple of `w`: one eigenvalue is not zero, and the inputs share it like the squares of
/// the components of `w` times the widths.
#[test]
fn a_ridge_has_one_direction() {
    let (weights, widths) = ([1.0, -2.0, 0.5], [1.0, 0.5, 4.0]);
    let mut rng = Stream::root(6).generator();
    let points = Matrix::from_fn(40, 3, |_, _| uniform(&mut rng));
    let along = |x: &[f64]| x.iter().zip(&weights).map(|(x, w)| x * w).sum::<f64>();
    let responses = values(&points, |x| along(x).sin());
    let mut gradients = Matrix::from_fn(40, 3, |i, j| along(points.row(i)).cos() * weights[j]);
    gradients.row_mut(7).fill(f64::NAN);
    let blocks = || std::iter::once(0..1);
    let found = active_subspace(&gradients, &widths, &responses, blocks(), &Stream::root(1));
    let found = found.unwrap();
    assert_eq!((found.runs, found.directions(0.99)), (39, 1));
    assert!(found.eigenvalues[1] < 1e-14 * found.eigenvalues[0]);
    for (j, share) in [1.0, 1.0, 4.0].into_iter().enumerate() {
        assert!((found.activity[j] / found.eigenvalues[0] - share / 6.0).abs() < 1e-12);
    }
    let unknown = Matrix::from_fn(40, 3, |_, _| f64::NAN);
    assert_eq!(active_subspace(&unknown, &widths, &responses, blocks(), &Stream::root(1)), None);
}

/// With normal inputs the gradient of `x'Ax / 2` has the mean outer product `A^2`. Intervals of 100 resampled runs are known
/// to be a little too narrow: they hold the eigenvalue in nine of ten cases or more, where the nominal share is 95 %.
#[test]
fn eigenvalues_of_gradients_have_their_spread() {
    let slopes = [3.0, 1.5, 0.5];
    let cases = 300;
    let mut inside = [0; 3];
    for case in 0..cases {
        let mut rng = Stream::root(case).generator();
        let points = Matrix::from_fn(100, 3, |_, _| normal(&mut rng));
        let responses =
            values(&points, |x| 0.5 * x.iter().zip(&slopes).map(|(x, a)| a * x * x).sum::<f64>());
        let gradients = Matrix::from_fn(100, 3, |i, j| slopes[j] * points[(i, j)]);
        let blocks = std::iter::once(0..1);
        let stream = Stream::root(case).named("resampled");
        let found = active_subspace(&gradients, &[1.0; 3], &responses, blocks, &stream).unwrap();
        let mean = responses.as_slice().iter().sum::<f64>() / 100.0;
        let variance = responses.as_slice().iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 100.0;
        for (i, (low, high)) in found.spread.iter().enumerate() {
            let truth = slopes[i] * slopes[i] / variance;
            inside[i] += usize::from(*low <= truth && truth <= *high);
        }
    }
    println!("inside of {cases}: {inside:?}");
    // The Monte Carlo error of a share of 0.92 in 300 cases is 0.016.
    let share = inside.map(|count| count as f64 / cases as f64);
    assert!(share.iter().all(|share| (0.87..=0.985).contains(share)), "{share:?}");
}

#[test]
fn of_many_outputs_evenly_spaced_ones_of_each_block_are_judged() {
    let responses = Matrix::from_fn(4, 1010, |i, j| (1000 * i + j) as f64);
    let (some, blocks) = few_outputs(&responses, [0..1000, 1000..1010].into_iter(), 410);
    assert_eq!(blocks, [0..100, 100..101]);
    assert_eq!([some.rows(), some.columns()], [4, 101]);
    assert_eq!([some[(2, 1)], some[(3, 99)], some[(0, 100)]], [2010.0, 3990.0, 1000.0]);
    let (all, blocks) = few_outputs(&responses, [0..1000, 1000..1010].into_iter(), 4040);
    assert_eq!((&*all, blocks), (&responses, vec![0..1000, 1000..1010]));
}

#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;

use super::*;
use crate::study::field::keys::FieldKernel;

fn grid(first: f64, last: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| first + (last - first) * i as f64 / (count - 1) as f64).collect()
}

fn bisected(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let side = f(low) > 0.0;
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == side { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Eigenvalues of `exp(-|x - y|/l)` on `[-a, a]`: `2 c/(w² + c²)` with `c = 1/l` and the roots `w` of `c - w tan(w a)` and
/// `w + c tan(w a)` in turn (Ghanem and Spanos, Stochastic Finite Elements (1991), 2.3.3).
fn closed_form(a: f64, length: f64, count: usize) -> Vec<(f64, f64)> {
    let c = 1.0 / length;
    let root = |k: usize| {
        let low = (k as f64) * PI / (2.0 * a);
        let high = low + PI / (2.0 * a);
        // Multiplied by the cosine, so that there is no pole.
        let even = |w: f64| c * (w * a).cos() - w * (w * a).sin();
        let odd = |w: f64| w * (w * a).cos() + c * (w * a).sin();
        if k.is_multiple_of(2) { bisected(even, low, high) } else { bisected(odd, low, high) }
    };
    (0..count).map(root).map(|w| (w, 2.0 * c / (w * w + c * c))).collect()
}

#[test]
fn eigenvalues_of_the_exponential_kernel_are_those_of_ghanem_and_spanos() {
    let (a, length) = (0.5, 0.4);
    let errors = |count: usize| {
        let at = grid(-a, a, count);
        let found =
            Expansion::new(&at, |h| FieldKernel::Exponential.at(h / length), Keep::Terms(8))
                .unwrap();
        let exact = closed_form(a, length, 8);
        let error = |(found, (_, exact)): (&f64, (f64, f64))| (found / exact - 1.0).abs();
        found.values.iter().zip(exact).map(error).collect::<Vec<f64>>()
    };
    // The trapezoidal rule has an error of second order in the spacing. The kernel has its kink at a place.
    let (coarse, fine) = (errors(101), errors(201));
    for (k, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
        assert!(*fine < 3e-3, "{k}: {fine}");
        assert!((3.5..4.5).contains(&(coarse / fine)), "{k}: {coarse} to {fine}");
    }
}

#[test]
fn eigenfunctions_of_the_exponential_kernel_are_cosines_and_sines() {
    let (a, length) = (0.5, 0.4);
    let at = grid(-a, a, 201);
    let found =
        Expansion::new(&at, |h| FieldKernel::Exponential.at(h / length), Keep::Terms(4)).unwrap();
    for (k, (w, _)) in closed_form(a, length, 4).into_iter().enumerate() {
        let sine = (2.0 * w * a).sin() / (2.0 * w);
        let exact = |x: f64| {
            if k.is_multiple_of(2) {
                (w * x).cos() / (a + sine).sqrt()
            } else {
                (w * x).sin() / (a - sine).sqrt()
            }
        };
        let sign = exact(at[20]).signum() * found.functions[(k, 20)].signum();
        for (i, x) in at.iter().enumerate() {
            let difference = found.functions[(k, i)] - sign * exact(*x);
            assert!(difference.abs() < 2e-3, "{k} at {x}: {difference}");
        }
    }
}

/// Eigenvalues of the squared exponential kernel under a normal density of the places are `√(2 a/A) B^k` (Zhu, Williams, Rohwer
/// and Morciniec (1998); Rasmussen and Williams (2006), 4.3.1); here the density is in the kernel, `√p(x) c(x - y) √p(y)`, which
/// has the same eigenvalues on a wide interval.
#[test]
fn eigenvalues_of_the_squared_exponential_kernel_are_geometric() {
    let (spread, length) = (1.0_f64, 0.8_f64);
    let at = grid(-9.0, 9.0, 401);
    let density =
        |x: f64| (-0.25 * (x / spread).powi(2)).exp() / (2.0 * PI * spread * spread).powf(0.25);
    let spacing = at[1] - at[0];
    let kernel = Matrix::from_fn(at.len(), at.len(), |i, j| {
        let h = (at[i] - at[j]) / length;
        spacing * density(at[i]) * FieldKernel::SquaredExponential.at(h.abs()) * density(at[j])
    });
    let mut values = symmetric_eigen(&kernel).unwrap().values;
    values.reverse();
    let (a, b) = (0.25 / (spread * spread), 0.5 / (length * length));
    let sum = a + b + (a * a + 2.0 * a * b).sqrt();
    for (k, found) in values.iter().take(10).enumerate() {
        let exact = (2.0 * a / sum).sqrt() * (b / sum).powi(k as i32);
        assert!((found / exact - 1.0).abs() < 1e-9, "{k}: {found} for {exact}");
    }
}

#[test]
fn all_terms_give_the_covariance_at_the_places() {
    let at = [0.0, 0.1, 0.15, 0.4, 1.0];
    for kernel in [FieldKernel::Exponential, FieldKernel::ThreeHalves, FieldKernel::FiveHalves] {
        let all = Expansion::new(&at, |h| kernel.at(h / 0.3), Keep::Terms(5)).unwrap();
        assert!((all.kept - 1.0).abs() < 1e-12);
        for i in 0..5 {
            for j in 0..5 {
                let product =
                    |k: usize| all.values[k] * all.functions[(k, i)] * all.functions[(k, j)];
                let found: f64 = (0..5).map(product).sum();
                let exact = kernel.at((at[i] - at[j]).abs() / 0.3);
                assert!((found - exact).abs() < 1e-12, "{i} {j}: {found} for {exact}");
            }
        }
    }
}

#[test]
fn as_many_terms_are_kept_as_the_share_of_the_variance_needs() {
    let at = grid(0.0, 1.0, 101);
    let kept = |keep| Expansion::new(&at, |h| FieldKernel::Exponential.at(h / 0.2), keep).unwrap();
    let found = kept(Keep::Variance(0.9));
    let terms = found.values.len();
    assert!(found.kept >= 0.9 && kept(Keep::Terms(terms - 1)).kept < 0.9);
    assert!(found.functions.rows() == terms && found.values.is_sorted_by(|a, b| a >= b));
}

//! Distributions against tables made by mpmath with 60 digits and by scipy.
//!
//! `golden.csv` is the output of this script (Python 3.11, mpmath 1.4.1, scipy 1.17.1):
//!
//! ```text
//! # Densities, distribution functions and quantiles with 60 digits; scipy gives only the starting point.
//! import mpmath as mp, scipy.stats as st
//! mp.mp.dps = 60
//! f = mp.mpf
//! def phi(z): return mp.erfc(-z / mp.sqrt(2)) / 2
//! def gam(k, s): return (st.gamma(k, scale=s),
//!     lambda x: mp.gammainc(f(k), 0, x / f(s), regularized=True),
//!     lambda x: mp.gammainc(f(k), x / f(s), mp.inf, regularized=True),
//!     lambda x: (k - 1) * mp.log(x / f(s)) - x / f(s) - mp.loggamma(f(k)) - mp.log(f(s)))
//! def igam(k, s): return (st.invgamma(k, scale=s),
//!     lambda x: mp.gammainc(f(k), s / x, mp.inf, regularized=True),
//!     lambda x: mp.gammainc(f(k), 0, s / x, regularized=True),
//!     lambda x: (k + 1) * mp.log(f(s) / x) - s / x - mp.loggamma(f(k)) - mp.log(f(s)))
//! def norm(m, s): return (st.norm(m, s), lambda x: phi((x - m) / f(s)), lambda x: phi(-(x - m) / f(s)),
//!     lambda x: -((x - m) / f(s)) ** 2 / 2 - mp.log(f(s) * mp.sqrt(2 * mp.pi)))
//! def logn(m, s): return (st.lognorm(s, scale=float(mp.exp(m))), lambda x: phi((mp.log(x) - m) / f(s)), lambda x: phi(-(mp.log(x) - m) / f(s)),
//!     lambda x: -((mp.log(x) - m) / f(s)) ** 2 / 2 - mp.log(x * f(s) * mp.sqrt(2 * mp.pi)))
//! def half(s): return (st.halfnorm(0, s), lambda x: mp.erf(x / s / mp.sqrt(2)), lambda x: mp.erfc(x / s / mp.sqrt(2)),
//!     lambda x: mp.log(2 / (f(s) * mp.sqrt(2 * mp.pi))) - (x / f(s)) ** 2 / 2)
//! def beta(a, b, lo, hi):
//!     w = f(hi) - f(lo)
//!     return (st.beta(a, b, lo, hi - lo),
//!     lambda x: mp.betainc(f(a), f(b), 0, (x - lo) / w, regularized=True),
//!     lambda x: mp.betainc(f(b), f(a), 0, (hi - x) / w, regularized=True),
//!     lambda x: (a - 1) * mp.log((x - lo) / w) + (b - 1) * mp.log((hi - x) / w) - mp.log(mp.beta(f(a), f(b)) * w))
//! def tail(v, t): return mp.betainc(f(v) / 2, f(1) / 2, 0, v / (v + t * t), regularized=True) / 2
//! def stu(v, m, s): return (st.t(v, m, s),
//!     lambda x: tail(v, (x - m) / f(s)) if x < m else 1 - tail(v, (x - m) / f(s)),
//!     lambda x: tail(v, (x - m) / f(s)) if x > m else 1 - tail(v, (x - m) / f(s)),
//!     lambda x: mp.loggamma(f(v + 1) / 2) - mp.loggamma(f(v) / 2) - mp.log(f(v) * mp.pi) / 2 - mp.log(f(s)) - f(v + 1) / 2 * mp.log(1 + ((x - m) / f(s)) ** 2 / v))
//! def hst(v, s): return (st.halfcauchy(0, s),
//!     lambda x: 1 - 2 * tail(v, x / f(s)), lambda x: 2 * tail(v, x / f(s)),
//!     lambda x: stu(v, 0, s)[3](x) + mp.log(2))
//! def tru(m, s, lo, hi):
//!     a, b = (f(lo) - m) / s, (f(hi) - m) / s
//!     Z = phi(-a) - phi(-b) if a > 0 else phi(b) - phi(a)
//!     return (st.truncnorm(float(a), float(b), m, s),
//!     lambda x: ((phi(-a) - phi(-(x - m) / s)) if a > 0 else (phi((x - m) / s) - phi(a))) / Z,
//!     lambda x: ((phi(-(x - m) / s) - phi(-b)) if a > 0 else (phi(b) - phi((x - m) / s))) / Z,
//!     lambda x: -((x - m) / f(s)) ** 2 / 2 - mp.log(s * mp.sqrt(2 * mp.pi) * Z))
//! def expo(m): return (st.expon(0, m), lambda x: 1 - mp.exp(-x / m), lambda x: mp.exp(-x / m), lambda x: -x / m - mp.log(m))
//! def uni(lo, hi): return (st.uniform(lo, hi - lo), lambda x: (x - lo) / (f(hi) - lo), lambda x: (hi - x) / (f(hi) - lo), lambda x: -mp.log(f(hi) - lo))
//! def logu(lo, hi):
//!     l = mp.log(f(hi) / f(lo))
//!     return (st.loguniform(lo, hi), lambda x: mp.log(x / f(lo)) / l, lambda x: mp.log(f(hi) / x) / l, lambda x: -mp.log(x * l))
//! def tri(lo, m, hi):
//!     w = f(hi) - lo
//!     return (st.triang((m - lo) / (hi - lo), lo, hi - lo),
//!     lambda x: (x - lo) ** 2 / (w * (m - lo)) if x < m else 1 - (hi - x) ** 2 / (w * (hi - m)),
//!     lambda x: 1 - (x - lo) ** 2 / (w * (m - lo)) if x < m else (hi - x) ** 2 / (w * (hi - m)),
//!     lambda x: mp.log(2 * (x - lo) / (w * (m - lo)) if x < m else 2 * (hi - x) / (w * (hi - m))))
//! inf = mp.inf
//! cases = [("uniform", uni, (-2, 3)), ("uniform", uni, (0, 1.5e6)), ("normal", norm, (3, 2)), ("normal", norm, (0, 1e-6)),
//!  ("half_normal", half, (1e-6,)), ("log_normal", logn, (0, 1)), ("log_normal", logn, (-20, 0.25)), ("log_normal", logn, (1, 3)),
//!  ("log_uniform", logu, (1e-10, 1e3)), ("gamma", gam, (0.1, 2)), ("gamma", gam, (0.5, 1e-3)), ("gamma", gam, (1, 3)),
//!  ("gamma", gam, (4.5, 1)), ("gamma", gam, (30, 0.1)), ("gamma", gam, (1000, 1e6)), ("inverse_gamma", igam, (0.1, 1)), ("inverse_gamma", igam, (3, 2e-4)),
//!  ("inverse_gamma", igam, (40, 10)), ("beta", beta, (0.1, 0.3, 0, 1)), ("beta", beta, (2, 5, 0, 1)), ("beta", beta, (5, 0.2, 0, 1)), ("beta", beta, (1, 3, 0, 2)),
//!  ("beta", beta, (500, 700, 0, 1)), ("beta", beta, (2, 3, 1500, 2000)), ("exponential", expo, (2.5,)), ("student_t", stu, (0.5, 0, 1)), ("student_t", stu, (1, 0, 2)),
//!  ("student_t", stu, (4, 1, 0.5)), ("student_t", stu, (200, 0, 1)), ("half_student_t", hst, (1, 2)), ("half_student_t", hst, (3, 0.5)), ("truncated_normal", tru, (0, 1, -1, 2)), ("truncated_normal", tru, (1, 2, 0, inf)),
//!  ("truncated_normal", tru, (0, 1, 30, inf)), ("truncated_normal", tru, (0, 1, 45, 46)), ("truncated_normal", tru, (0, 1, -inf, -8)), ("triangular", tri, (0, 0.25, 1)), ("triangular", tri, (-1, 3, 3.5))]
//! ps = [1e-10, 1e-6, 1e-3, 0.01, 0.25, 0.5, 0.75, 0.99, 0.999, 1 - 1e-6, 1 - 1e-10]
//! num = lambda x: repr(float(x))
//! print("distribution,numbers,p,quantile,log_density,cdf")
//! for name, make, args in cases:
//!     law, cdf, sf, ln = make(*args)
//!     for p in ps:
//!         target, g = (mp.log(f(p)), cdf) if p <= 0.5 else (mp.log(1 - f(p)), sf)
//!         lo, hi = law.support(); lo, hi = f(lo), f(hi)
//!         x0 = float(law.ppf(p)) if name != "truncated_normal" or args[2] != 45 else 45.5
//!         if not (lo < x0 < hi): x0 = float(law.mean())
//!         h = lambda x: mp.log(g(x)) - target
//!         # a bracket around scipy's answer, widened in the coordinate in which the support is unbounded
//!         if lo == 0 and hi == inf: T, U = mp.exp, mp.log
//!         elif lo == 0: T, U = (lambda u: hi / (1 + mp.exp(-u))), (lambda x: mp.log(x / (hi - x)))
//!         elif lo > -inf and hi < inf: T, U = (lambda u: lo + (hi - lo) / (1 + mp.exp(-u))), (lambda x: mp.log((x - lo) / (hi - x)))
//!         elif lo > -inf: T, U = (lambda u: lo + mp.exp(u)), (lambda x: mp.log(x - lo))
//!         elif hi < inf: T, U = (lambda u: hi - mp.exp(-u)), (lambda x: -mp.log(hi - x))
//!         else: T, U = mp.sinh, mp.asinh
//!         u0, d = U(f(x0)), f(1) / 10 ** 6
//!         k = lambda u: h(T(u))
//!         s = 1 if p <= 0.5 else -1
//!         a, b = u0 - d, u0 + d
//!         while s * k(a) > 0: d *= 4; a -= d
//!         d = f(1) / 10 ** 6
//!         while s * k(b) < 0: d *= 4; b += d
//!         u = mp.findroot(k, (a, b), solver="anderson", tol=1e-45, maxsteps=300, verify=False)
//!         for _ in range(3):   # secant polish
//!             e = f(10) ** -20 * (1 + abs(u)); u -= k(u) * 2 * e / (k(u + e) - k(u - e))
//!         x = f(float(T(u)))
//!         if not mp.isfinite(x): continue   # nearer to a bound than 60 digits tell
//!         numbers = " ".join(str(float(v)) for v in args)
//!         print(",".join([name, numbers, repr(p), num(x), num(ln(x)), num(cdf(x))]))
//! ```

// Reference values keep the digits that the programs print.
#![allow(clippy::unreadable_literal)]

use super::Distribution;
use crate::math::random::Stream;

fn read(text: &str) -> Distribution {
    toml::from_str(text).unwrap()
}

struct Row {
    law: Distribution,
    p: f64,
    quantile: f64,
    log_density: f64,
    cdf: f64,
}

fn golden() -> Vec<Row> {
    let rows = include_str!("golden.csv").lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let numbers = cells[1].replace(' ', ", ");
        let numbers = if cells[1].contains(' ') { format!("[{numbers}]") } else { numbers };
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        Row {
            law: read(&format!("{} = {numbers}", cells[0])),
            p: number(2),
            quantile: number(3),
            log_density: number(4),
            cdf: number(5),
        }
    });
    rows.collect()
}

fn near(found: f64, expected: f64, relative: f64) -> bool {
    (found - expected).abs() <= relative * expected.abs() + 1e-30
}

#[test]
fn quantiles_hold_to_the_far_tails() {
    for row in golden() {
        let found = row.law.quantile(row.p);
        assert!(near(found, row.quantile, 1e-10), "{}, p {}: {found:e}", row.law, row.p);
    }
}

#[test]
fn distribution_functions_hold_to_the_far_tails() {
    for row in golden() {
        let found = row.law.cdf(row.quantile);
        assert!(near(found, row.cdf, 1e-10), "{}, p {}: {found:e}", row.law, row.p);
    }
}

#[test]
fn log_densities_are_those_of_the_table() {
    for row in golden().iter().filter(|row| row.log_density.is_finite()) {
        let found = row.law.log_density(row.quantile);
        let bound = 1e-11 * row.log_density.abs().max(1.0);
        assert!((found - row.log_density).abs() < bound, "{}, p {}: {found}", row.law, row.p);
    }
}

#[test]
fn derivatives_are_the_slopes_of_the_log_density() {
    // Central differences with step h have an error of about h^2 in units of the distribution's own scale.
    for row in golden().iter().filter(|r| r.p > 0.005 && r.p < 0.995 && r.log_density.is_finite()) {
        let x = row.quantile;
        let (lo, hi) = row.law.support();
        let scale = row.law.quantile(0.6) - row.law.quantile(0.4);
        let h = 1e-5 * scale.min(x - lo).min(hi - x);
        let slope = (row.law.log_density(x + h) - row.law.log_density(x - h)) / (2.0 * h);
        let found = row.law.log_density_derivative(x);
        if h < 1e-10 * x.abs() {
            continue;
        }
        let kink =
            matches!(row.law, Distribution::Triangular([_, mode, _]) if (mode - x).abs() <= h);
        let bound = 2e-5 * (slope.abs() + 1.0 / scale);
        assert!(kink || (found - slope).abs() < bound, "{} at {x}: {found} {slope}", row.law);
    }
}

/// Source: mean and variance from scipy 1.17.1, `law.mean()` and `law.var()`; of `half_student_t` from mpmath 1.4.1, by quadrature of its
/// density with 40 digits.
const MOMENTS: [(&str, f64, f64); 14] = [
    ("uniform = [-2, 3]", 0.5, 2.083333333333333),
    ("normal = [3, 2]", 3.0, 4.0),
    ("half_normal = 2", 1.5957691216057308, 1.4535209105296745),
    ("log_normal = [1, 0.5]", 3.080216848918031, 2.694758124344946),
    ("log_uniform = [0.01, 10]", 1.4462006247378292, 5.146737879820747),
    ("gamma = [4.5, 2]", 9.0, 18.0),
    ("inverse_gamma = [5, 3]", 0.75, 0.1875),
    ("beta = [2, 5, 1, 4]", 1.8571428571428572, 0.22959183673469388),
    ("exponential = 2.5", 2.5, 6.25),
    ("student_t = [5, 1, 2]", 1.0, 6.666666666666667),
    ("truncated_normal = [1, 2, 0, 4]", 1.7125457683541194, 1.1209926006049002),
    ("truncated_normal = [0, 1, 3, inf]", 3.28309865493044, 0.07055918678525586),
    ("triangular = [-1, 3, 3.5]", 1.8333333333333335, 1.0138888888888888),
    ("half_student_t = [5, 2]", 1.8980334491124722, 3.0641356927168792),
];

#[test]
fn means_and_variances_are_those_of_scipy_and_mpmath() {
    for (text, mean, variance) in MOMENTS {
        let law = read(text);
        assert!(near(law.mean(), mean, 1e-12), "{law}: {}", law.mean());
        assert!(near(law.variance(), variance, 1e-10), "{law}: {}", law.variance());
    }
}

#[test]
fn the_mode_has_the_largest_density() {
    for (text, _, _) in MOMENTS {
        let law = read(text);
        let top = law.log_density(law.mode());
        let higher = (1..200).any(|i| law.log_density(law.quantile(f64::from(i) / 200.0)) > top);
        assert!(!higher, "{law}");
    }
}

#[test]
fn draws_follow_the_distribution_function() {
    // Kolmogorov-Smirnov: with probability 0.999 the distance is below 1.95 / sqrt(n).
    let n = 2000_usize;
    for (i, (text, _, _)) in MOMENTS.into_iter().enumerate() {
        let law = read(text);
        let mut rng = Stream::root(5).at(i as u64).generator();
        let mut draws: Vec<f64> = (0..n).map(|_| law.sample(&mut rng)).collect();
        draws.sort_by(f64::total_cmp);
        let distance = draws.iter().enumerate().fold(0.0_f64, |worst, (i, &x)| {
            let (below, above) = (i as f64 / n as f64, (i + 1) as f64 / n as f64);
            worst.max(law.cdf(x) - below).max(above - law.cdf(x))
        });
        assert!(distance < 1.95 / (n as f64).sqrt(), "{law}: {distance}");
    }
}

/// Distributions with parameters of all magnitudes.
fn any_law(kind: u32, size: &mut impl FnMut() -> f64) -> Distribution {
    let (a, b, c) = (size(), size(), size());
    match kind {
        0 => Distribution::Uniform([-a, b]),
        1 => Distribution::Normal([a - b, c]),
        2 => Distribution::HalfNormal(a),
        3 => Distribution::LogNormal([b.ln(), a.min(20.0)]),
        4 => Distribution::LogUniform([a, a * (1.0 + b)]),
        5 => Distribution::Gamma([a, b]),
        6 => Distribution::InverseGamma([a, b]),
        7 => Distribution::Beta([a, b, -1.0, 1.0]),
        8 => Distribution::Exponential(a),
        9 => Distribution::StudentT([a, 0.0, b]),
        10 => Distribution::HalfStudentT([a, b]),
        11 => Distribution::TruncatedNormal([(b - c).clamp(-b - 99.0 * a, c + 99.0 * a), a, -b, c]),
        _ => Distribution::Triangular([0.0, a, a + b]),
    }
}

#[test]
fn quantiles_grow_inside_the_support_whatever_the_numbers() {
    let mut rng = Stream::root(11).generator();
    let mut size = || Distribution::LogUniform([1e-4, 1e4]).sample(&mut rng);
    for round in 0..50 {
        for kind in 0..13 {
            let law = any_law(kind, &mut size);
            assert_eq!(law.check(), Ok(()), "{law}");
            let (lo, hi) = law.support();
            let mut last = lo;
            for p in [1e-12, 1e-5, 0.03, 0.3, 0.5, 0.7, 0.98, 1.0 - 1e-9] {
                let x = law.quantile(p);
                // Neighbouring quantiles may round to the same number, each to its own last digit.
                let grows = x >= last || last - x <= 1e-13 * last.abs();
                assert!(x >= lo && x <= hi && grows, "{round}: {law}, p {p}: {x}");
                assert!(!law.log_density(x).is_nan() && !law.log_density_derivative(x).is_nan());
                last = x;
                // The tolerance is the probability within one rounding of x.
                let (below, above) = (law.cdf(x * (1.0 - 1e-15)), law.cdf(x * (1.0 + 1e-15)));
                let rounding = (above - below).abs();
                let bound = 1e-9 * p + 4.0 * rounding;
                assert!(
                    x.is_infinite()
                        || x == 0.0
                        || x == lo
                        || x == hi
                        || (law.cdf(x) - p).abs() <= bound,
                    "{round}: {law}, p {p}: {x}, {:e}",
                    law.cdf(x) - p
                );
            }
        }
    }
}

#[test]
fn a_log_uniform_law_spans_six_hundred_decades() {
    let law = Distribution::LogUniform([1e-300, 1e300]);
    for (p, expected) in [(0.25, 1e-150), (0.5, 1.0), (0.75, 1e150), (0.999, 10_f64.powf(299.4))] {
        assert!(near(law.quantile(p), expected, 1e-10), "{p}: {:e}", law.quantile(p));
        assert!(near(law.cdf(expected), p, 1e-12));
    }
}

#[test]
fn what_is_written_is_read_again() {
    for (text, _, _) in MOMENTS {
        let law = read(text);
        assert_eq!(read(&toml::to_string(&law).unwrap()), law);
        // JSON has no infinity; the open bound of a truncated normal distribution must survive nevertheless.
        let json = serde_json::to_string(&law).unwrap();
        assert_eq!(serde_json::from_str::<Distribution>(&json).unwrap(), law);
    }
    assert_eq!(read("beta = [2, 3]"), Distribution::Beta([2.0, 3.0, 0.0, 1.0]));
}

#[test]
fn complaints_say_what_was_expected_and_what_was_found() {
    for (text, message) in [
        ("uniform = [3, 1]", "expected the lower bound below the upper, found [3, 1]"),
        ("uniform = [1, nan]", "expected finite numbers, found [1, NaN]"),
        ("uniform = 3", "expected `uniform` to be [lower bound, upper bound], found 3"),
        ("normal = [1]", "expected `normal` to be [mean, standard deviation], found [1]"),
        ("half_normal = -1e-6", "expected a scale above zero, found -1e-6"),
        ("half_normal = [1]", "expected `half_normal` to be a scale, found [1]"),
        ("log_uniform = [0, 1]", "expected bounds above zero, found [0, 1]"),
        ("beta = [2, 2, 1, 0]", "expected the lower bound below the upper, found [2, 2, 1, 0]"),
        (
            "triangular = [0, 2, 1]",
            "expected the mode between a lower and a higher bound, found [0, 2, 1]",
        ),
        (
            "truncated_normal = [0, 1, 2, 2]",
            "expected the lower bound below the upper, found [0, 1, 2, 2]",
        ),
        (
            "truncated_normal = [0, 1, 2000, inf]",
            "expected bounds at most 1000 standard deviations from the mean, found [0, 1, 2000, inf]",
        ),
        (
            "truncated_normal = [0.5, 0.25, nan, 1.5]",
            "expected finite numbers, found [0.5, 0.25, NaN, 1.5]",
        ),
        (
            "quantiles = [nan, inf, 2, 0.1, 0.2, 0.3]",
            "expected increasing quantiles inside the bounds, found [NaN, inf, 2, 0.1, 0.2, 0.3]",
        ),
        ("quantiles = [0, nan, 2, 0.1, 0.2, 0.3]", "expected increasing quantiles inside"),
        ("beta = [1e300, 1e-300]", "expected a and b of at most 1e9, found [1e300, 1e-300, 0, 1]"),
        ("beta = [2, 1.5e9]", "expected a and b of at most 1e9, found [2, 1.5e9, 0, 1]"),
        ("normal = [0, 1e155]", "expected numbers of a size between 1e-100 and 1e100"),
        ("uniform = [0.5, 0.500000000000001]", "an interval that is wider than rounding"),
        ("normal = [1.7e9, 1e-6]", "a standard deviation above rounding, 1e-14 of the mean"),
        ("half_normal = 1e-296", "in another unit if need be, found 1e-296"),
        ("truncated_normal = [0, 1e-200, 0, inf]", "found [0, 1e-200, 0, inf]"),
        ("log_normal = [1000, 1]", "expected a mu and a sigma between -230 and 230"),
        ("unifrom = [0, 1]", "found `unifrom` (did you mean `uniform`?)"),
        (
            "normal = [0, 1]\ngamma = [1, 1]",
            "expected one distribution, found `normal` and `gamma`",
        ),
        ("normal = [\"a\", 1]", "expected a number or a list of numbers"),
        ("", "found an empty table"),
    ] {
        let error = toml::from_str::<Distribution>(text).unwrap_err().to_string();
        assert!(error.contains(message), "{text}: {error}");
    }
}

#[test]
fn small_bounds_beside_an_ordinary_scale_are_allowed() {
    for text in [
        "uniform = [1e-300, 1]",
        "log_uniform = [1e-300, 1e300]",
        "truncated_normal = [0, 1, 0, 1e300]",
        "inverse_gamma = [1e-3, 1e-3]",
        "normal = [1.7e9, 1e-3]",
    ] {
        read(text);
    }
}

#[test]
fn a_person_reads_it_in_words() {
    assert_eq!(read("uniform = [0, 1.5e6]").to_string(), "uniform on [0, 1.5e6]");
    assert_eq!(read("half_normal = 1e-6").to_string(), "half-normal of scale 1e-6");
    assert_eq!(read("normal = [12112, 15.5]").to_string(), "normal, mean 12112, sd 15.5");
}

#[test]
fn the_schema_describes_each_distribution() {
    let schema = serde_json::to_value(schemars::schema_for!(Distribution)).unwrap();
    let forms = schema["oneOf"].as_array().unwrap();
    assert_eq!(forms.len(), 14);
    assert!(forms.iter().all(|form| form["description"].is_string()));
}

use crate::math::distribution::Distribution;
use crate::math::moments::{mean, variance};
use crate::math::random::Stream;

/// The distribution by the exact quantiles of another at scores from -3 to 3.
fn by_quantiles(law: &Distribution, support: (f64, f64)) -> Distribution {
    let mut numbers = vec![support.0, support.1, 3.0];
    numbers.extend((-12..=12).map(|k| law.at_score(0.25 * f64::from(k))));
    let law = Distribution::Quantiles(numbers);
    law.check().unwrap();
    law
}

/// Normal, log-normal and (by its logit) logit-normal distributions are linear in the score, and therefore exact.
#[test]
fn normal_coordinates_are_exact() {
    let infinite = (f64::NEG_INFINITY, f64::INFINITY);
    for (law, support) in [
        (Distribution::Normal([2.0, 3.0]), infinite),
        (Distribution::LogNormal([0.5, 0.7]), (0.0, f64::INFINITY)),
    ] {
        let found = by_quantiles(&law, support);
        for z in [-5.0, -3.0, -1.3, 0.1, 2.9, 4.5] {
            let x = law.at_score(z);
            assert!((found.log_density(x) - law.log_density(x)).abs() < 1e-9, "{law} at {x}");
            assert!(
                (found.score(x) - z).abs() < 1e-9 && (found.at_score(z) / x - 1.0).abs() < 1e-9
            );
            let (a, b) = (found.log_density_derivative(x), law.log_density_derivative(x));
            assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{law} at {x}: {a} {b}");
        }
        assert!((found.mean() / law.mean() - 1.0).abs() < 1e-9);
        assert!((found.variance() / law.variance() - 1.0).abs() < 1e-8);
    }
}

/// Other shapes are near their distribution, have the integral one, exact derivatives, and quantiles that invert the
/// distribution function.
#[test]
fn other_shapes_are_near_and_consistent() {
    let cases = [
        (Distribution::Gamma([2.0, 1.5]), (0.0, f64::INFINITY)),
        (Distribution::Uniform([-1.0, 2.0]), (-1.0, 2.0)),
        (Distribution::Beta([2.0, 5.0, 0.0, 1.0]), (0.0, 1.0)),
        (Distribution::StudentT([5.0, 1.0, 2.0]), (f64::NEG_INFINITY, f64::INFINITY)),
    ];
    for (law, support) in cases {
        let found = by_quantiles(&law, support);
        let (mut distance, mut whole) = (0.0_f64, 0.0);
        let ends = [1e-6, 1.0 - 1e-6].map(|p| found.quantile(p));
        let count = 20_000;
        let step = (ends[1] - ends[0]) / f64::from(count);
        for i in 0..count {
            let x = ends[0] + step * (f64::from(i) + 0.5);
            let density = found.log_density(x).exp();
            whole += step * density;
            distance += 0.5 * step * (density - law.log_density(x).exp()).abs();
        }
        assert!((whole - 1.0).abs() < 1e-4, "{law}: {whole}");
        assert!(distance < 0.01, "{law}: total variation {distance}");
        for p in [0.001, 0.03, 0.4, 0.77, 0.999] {
            let x = found.quantile(p);
            assert!((found.cdf(x) - p).abs() < 1e-9, "{law}");
            let by = 1e-6 * law.sd();
            let difference = (found.log_density(x + by) - found.log_density(x - by)) / (2.0 * by);
            let slope = found.log_density_derivative(x);
            assert!((slope - difference).abs() < 1e-4 * (1.0 + slope.abs()), "{law} at {x}");
        }
        let mode = found.log_density(found.mode());
        assert!(
            (0..100)
                .all(|i| found.log_density(found.quantile(f64::from(i) / 100.0)) <= mode + 1e-3)
        );
    }
}

/// A distribution of draws has their mean and spread within the errors of 4000 draws.
#[test]
fn draws_make_a_distribution() {
    let law = Distribution::Gamma([3.0, 2.0]);
    let mut rng = Stream::root(8).generator();
    let draws: Vec<f64> = (0..4000).map(|_| law.sample(&mut rng)).collect();
    let found = Distribution::of_draws(&draws, (0.0, f64::INFINITY), 4000.0).unwrap();
    assert!((found.mean() - mean(&draws)).abs() < 0.02 * law.sd(), "{}", found.mean());
    assert!((found.sd() / variance(&draws).sqrt() - 1.0).abs() < 0.03, "{}", found.sd());
    assert!(Distribution::of_draws(&draws[..20], (0.0, f64::INFINITY), 20.0).is_none());
    assert!(Distribution::of_draws(&[1.0; 500], (0.0, f64::INFINITY), 500.0).is_none());
}

/// Infinite bounds are `null` in JSON and come back.
#[test]
fn it_is_written_and_read() {
    let law = by_quantiles(&Distribution::Normal([0.0, 1.0]), (f64::NEG_INFINITY, f64::INFINITY));
    let text = serde_json::to_string(&law).unwrap();
    assert_eq!(serde_json::from_str::<Distribution>(&text).unwrap(), law);
    let wrong = r#"{ "quantiles": [0, 1, 2, 0.5, 0.4, 0.6] }"#;
    assert!(serde_json::from_str::<Distribution>(wrong).is_err());
}

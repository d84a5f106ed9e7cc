use super::bench::*;
use crate::surrogates::polynomial_chaos::PolynomialChaos;
use lacuna::linalg::Matrix;
use lacuna::plugin::Emulator;
use lacuna::plugin::surrogate::Linear;

fn wave(u: &[f64], o: usize) -> f64 {
    let (sensor, time) = ((o / 100) as f64, (o % 100) as f64 / 100.0);
    let [c, r, s] = [u[0], 1.0 + 0.36 * u[1], 1.2 + u[2]];
    let since = time - 0.05 * sensor / s;
    let envelope = 1.0 / (1.0 + (-40.0 * since).exp()) * (-since * (2.0 + c)).exp();
    1e-4 * r * envelope * ((9.0 + sensor) * s * since / r).sin()
        + 3e-6 * (u[0] + time - 0.7 * u[1]).abs()
}

pub fn run(outputs: usize, n: usize, json: &str) -> Vec<u64> {
    let options: PolynomialChaos = serde_json::from_str(json).unwrap();
    let unit = latin_hypercube(n, 3, 11);
    let b = [[0.0, 1.5e7], [1.1e4, 1.4e4], [1200.0, 1800.0]];
    let points = scaled(&unit, &b);
    let step = 1000 / outputs;
    let responses = Matrix::from_fn(n, outputs, |i, o| wave(unit.row(i), o * step));
    let t = std::time::Instant::now();
    let fit = fitted(&options, &b, &points, &responses).unwrap();
    println!("{outputs} outputs {json}: {:?}", t.elapsed());
    let loo = &fit.fit_error().relative;
    let mut sorted = loo.clone();
    sorted.sort_by(f64::total_cmp);
    println!(
        "  loo median {:.3e} mean {:.3e}",
        sorted[outputs / 2],
        loo.iter().sum::<f64>() / outputs as f64
    );
    for f in fit.facts() {
        println!("  {}: {}", f.name, f.value);
    }
    let terms = fit.coefficients().rows();
    let factor = Matrix::from_fn(terms + 40, terms + 1, |i, j| ((i * 7 + j * 3) as f64).sin());
    let squares = fit
        .sum_of_squares(&factor)
        .map(|s| [s.values(&points), s.gradient(points.row(1)), vec![s.error()]].concat())
        .unwrap_or_default();
    [
        fit.coefficients().as_slice(),
        loo,
        fit.fit_error().residuals.as_slice(),
        fit.mean(&points).as_slice(),
        fit.jacobian(points.row(3)).as_slice(),
        &squares,
    ]
    .concat()
    .iter()
    .map(|x| x.to_bits())
    .collect()
}

#[test]
#[ignore]
fn baseline() {
    let legendre = r#"{"basis":"legendre","degree":{"max":20}}"#;
    let ls = r#"{"basis":"legendre","solver":"least_squares","degree":{"max":6}}"#;
    let q = r#"{"basis":"legendre","q_norm":0.7,"max_interaction":2,"degree":{"max":12}}"#;
    let all: Vec<u64> = [run(40, 480, legendre), run(20, 480, ls), run(10, 100, q)].concat();
    let bytes: Vec<u8> = all.iter().flat_map(|x| x.to_le_bytes()).collect();
    let path = "/tmp/pce_base.bin";
    if std::path::Path::new(path).exists() {
        assert!(std::fs::read(path).unwrap() == bytes, "bits differ");
    } else {
        std::fs::write(path, bytes).unwrap();
    }
}

#[test]
#[ignore]
fn thousand() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| run(1000, 480, r#"{"degree":{"max":20}}"#));
}

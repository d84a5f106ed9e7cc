//! The study of a measured force with shortened records, compared with the exact motion under a piecewise linear force.

use std::path::Path;

use crate::quick;

/// Number of points of the records that are kept.
const KEPT: [(&str, usize); 2] = [("weak", 300), ("strong", 200)];
/// Standard deviation of the measurement noise, mm.
const NOISE: f64 = 0.5;

struct Record {
    at: Vec<f64>,
    force: Vec<f64>,
    times: Vec<f64>,
    measured: Vec<f64>,
}

fn column(text: &str, column: usize) -> Vec<f64> {
    let cell = |line: &str| line.split(',').nth(column).unwrap().parse().unwrap();
    text.lines().skip(1).map(cell).collect()
}

/// Copies the study with only the first points of its records.
fn cut(from: &Path, to: &Path) -> Vec<Record> {
    std::fs::copy(from.join("study.toml"), to.join("study.toml")).unwrap();
    let head = |file: String, lines: usize| {
        let text = std::fs::read_to_string(from.join(&file)).unwrap();
        let cut = text.lines().take(1 + lines).collect::<Vec<_>>().join("\n") + "\n";
        std::fs::write(to.join(&file), &cut).unwrap();
        cut
    };
    let record = |(name, points): (&str, usize)| {
        let measured = head(format!("position-{name}.csv"), points);
        // The force is known slightly longer than the motion.
        let force = head(format!("force-{name}.csv"), 2 * points);
        let (at, force) = (column(&force, 0), column(&force, 1));
        Record { at, force, times: column(&measured, 1), measured: column(&measured, 2) }
    };
    KEPT.into_iter().map(record).collect()
}

/// `m x'' + c x' + k x = F(t)` from rest, in mm: on each linear piece of the force
/// `x = p + q τ + e^(-δτ) (a cos ωτ + b sin ωτ)`.
fn motion([mass, damping, stiffness]: [f64; 3], record: &Record) -> Vec<f64> {
    let decay = 0.5 * damping / mass;
    let omega = (stiffness / mass - decay * decay).sqrt();
    let (mut x, mut v) = (0.0, 0.0);
    let mut times = record.times.iter().peekable();
    let mut positions = Vec::new();
    for i in 0..record.at.len() - 1 {
        let (begin, end) = (record.at[i], record.at[i + 1]);
        let q = (record.force[i + 1] - record.force[i]) / (end - begin) / stiffness;
        let p = record.force[i] / stiffness - damping * q / stiffness;
        let a = x - p;
        let b = (v - q + decay * a) / omega;
        let piece = |t: f64| {
            let tau = t - begin;
            let ((sin, cos), fade) = ((omega * tau).sin_cos(), (-decay * tau).exp());
            let vibration = fade * (a * cos + b * sin);
            let speed = q + fade * omega * (b * cos - a * sin) - decay * vibration;
            (p + q * tau + vibration, speed)
        };
        while let Some(t) = times.next_if(|t| **t <= end) {
            positions.push(1e3 * piece(*t).0);
        }
        (x, v) = piece(end);
    }
    positions
}

/// Derivatives of all positions by each parameter, by central differences.
fn slopes(point: [f64; 3], records: &[Record]) -> [Vec<f64>; 3] {
    std::array::from_fn(|j| {
        let step = 1e-4 * point[j];
        let at = |sign: f64| {
            let mut moved = point;
            moved[j] += sign * step;
            records.iter().flat_map(|record| motion(moved, record)).collect::<Vec<f64>>()
        };
        at(1.0).iter().zip(at(-1.0)).map(|(up, down)| (up - down) / (2.0 * step)).collect()
    })
}

/// Inverse of a symmetric 3 x 3 matrix, by cofactors.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let ([a, b], [c, d]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}

/// Best fit by the Gauss-Newton method, and its covariance.
fn least_squares(records: &[Record]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut point = [2.0, 1.6, 80.0];
    let mut covariance = [[0.0; 3]; 3];
    for _ in 0..8 {
        let slopes = slopes(point, records);
        let misfit: Vec<f64> = records
            .iter()
            .flat_map(|r| {
                r.measured.iter().zip(motion(point, r)).map(|(y, x)| y - x).collect::<Vec<_>>()
            })
            .collect();
        let product = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / (NOISE * NOISE)
        };
        let information: [[f64; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| product(&slopes[i], &slopes[j])));
        covariance = inverse(information);
        for (i, row) in covariance.iter().enumerate() {
            point[i] += (0..3).map(|j| row[j] * product(&slopes[j], &misfit)).sum::<f64>();
        }
    }
    (point, covariance)
}

#[test]
fn a_measured_force_drives_the_motion() {
    let from = quick::root().join("configs/forced_oscillator");
    let folder = tempfile::tempdir().unwrap();
    let records = cut(&from, folder.path());
    let out = folder.path().join("run");
    let settings = ["sampler.warm_up=50", "sampler.steps=200"];
    quick::run(&folder.path().join("study.toml"), &settings, &out)
        .unwrap_or_else(|stop| panic!("{stop}"));
    let found = quick::summary(&out);
    let (best, covariance) = least_squares(&records);
    for (i, name) in ["mass", "damping", "stiffness"].into_iter().enumerate() {
        let number = |key: &str| found["parameters"][name][key].as_f64().unwrap();
        let sd = covariance[i][i].sqrt();
        // The optimum is that of the exact motion; mean and standard deviation are within the Monte Carlo error of some
        // 400 draws plus the non-normality of the posterior, which is of the order of the relative deviation.
        assert!(
            (number("map") - best[i]).abs() < 0.01 * sd,
            "{name}: {} {}",
            number("map"),
            best[i]
        );
        assert!((number("mean") - best[i]).abs() < 0.35 * sd, "{name}: {}", number("mean"));
        assert!((number("sd") / sd - 1.0).abs() < 0.25, "{name}: {} {sd}", number("sd"));
        let truth = number("reference");
        assert!((number("mean") - truth).abs() < 4.0 * sd, "{name}: {}", number("mean"));
    }
    assert_eq!(found["data"]["count"], KEPT.iter().map(|(_, points)| points).sum::<usize>());
}

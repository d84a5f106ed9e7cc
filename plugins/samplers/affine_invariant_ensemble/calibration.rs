//! A complete small calibration: best fit, walkers around it, ensemble, diagnosis.
//!
//! The problem is shaped like the inversion on which samplers that start from draws of the prior lose most of their
//! walkers: three parameters of decaying oscillations at several sensors, and one unknown variance per sensor with a
//! wide uniform prior.

use lacuna::diagnose::Diagnosis;
use lacuna::math::random::normal;
use lacuna_optimise::{laplace, maximise, scatter};

use super::tests::run_from;
use super::*;

const SENSORS: usize = 4;
const TIMES: usize = 12;
const NOISE: f64 = 0.01;
const TRUTH: [f64; 3] = [0.3, -0.2, 0.4];

struct Oscillations {
    data: Vec<f64>,
}

/// Returns the signal and its derivatives with respect to the three parameters.
fn signal(theta: &[f64], sensor: usize, time: usize) -> (f64, [f64; 3]) {
    let (t, s) = (0.5 * (1 + time) as f64, 1.0 + 0.2 * sensor as f64);
    let decay = (-0.3 * (1.5 + theta[0]) * t).exp();
    let phase = s * (2.0 + theta[1]) * t + theta[2];
    let (sin, cos) = phase.sin_cos();
    (decay * sin, [-0.3 * t * decay * sin, s * t * decay * cos, decay * cos])
}

impl Oscillations {
    fn new(seed: u64) -> Self {
        let mut rng = Stream::root(seed).named("noise").generator();
        let places = (0..SENSORS).flat_map(|s| (0..TIMES).map(move |t| (s, t)));
        let data = places.map(|(s, t)| signal(&TRUTH, s, t).0 + NOISE * normal(&mut rng)).collect();
        Self { data }
    }
}

impl Target for Oscillations {
    fn dimension(&self) -> usize {
        3 + SENSORS
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|x| self.gradient(x).0).collect()
    }

    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let outside = x.iter().zip(self.bounds()).any(|(x, (lo, hi))| *x < lo || *x > hi);
        if outside || x[3..].iter().any(|v| *v <= 0.0) {
            return (f64::NEG_INFINITY, vec![0.0; x.len()]);
        }
        let (mut value, mut gradient) = (0.0, vec![0.0; x.len()]);
        for sensor in 0..SENSORS {
            let variance = x[3 + sensor];
            let mut squares = 0.0;
            for time in 0..TIMES {
                let (y, slopes) = signal(x, sensor, time);
                let residual = self.data[sensor * TIMES + time] - y;
                squares += residual * residual;
                for (g, slope) in gradient.iter_mut().zip(slopes) {
                    *g += residual * slope / variance;
                }
            }
            let count = TIMES as f64;
            value -= 0.5 * (squares / variance + count * variance.ln());
            gradient[3 + sensor] = 0.5 * (squares / variance - count) / variance;
        }
        (value, gradient)
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let volume = 3.0 * 2.0_f64.ln();
        let inside =
            |x: &[f64]| x.iter().zip(self.bounds()).all(|(x, (lo, hi))| lo <= *x && *x <= hi);
        points.iter_rows().map(|x| if inside(x) { -volume } else { f64::NEG_INFINITY }).collect()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        (0..self.dimension()).map(|j| if j < 3 { (-1.0, 1.0) } else { (0.0, 1.0) }).collect()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.dimension(), |_, j| {
            if j < 3 { 2.0 * uniform(&mut rng) - 1.0 } else { uniform(&mut rng) }
        })
    }
}

#[test]
fn no_walker_is_lost_when_the_ensemble_starts_around_the_best_fit() {
    for seed in 0..2 {
        let target = Oscillations::new(seed);
        let root = Stream::root(seed);
        let optima = maximise(&target, &target.prior_draws(30, &root.named("starts")));
        let best = &optima[0];
        assert!(best.converged, "seed {seed}: {best:?}");
        let shape = laplace(&target, &best.point).unwrap();
        let sampler = AffineInvariantEnsemble { steps: 3500, ..Default::default() };
        let points =
            scatter(&target, &best.point, &shape, sampler.walkers, &root.named("walkers")).unwrap();
        let draws = run_from(&sampler, &target, points, seed, sampler.steps / 2);
        let diagnosis = Diagnosis::of(&draws, true);
        let stranded = &diagnosis.stranded;
        assert!(stranded.to_the_end.is_empty() && stranded.late.is_empty(), "{stranded:?}");
        assert!(diagnosis.converged, "seed {seed}: {:?}", diagnosis.advice);
        // With 48 data the posterior of the parameters is nearly normal.
        for (j, truth) in TRUTH.into_iter().enumerate() {
            let sd = shape.covariance[(j, j)].sqrt();
            assert!((best.point[j] - truth).abs() < 4.0 * sd, "seed {seed}: {:?}", best.point);
            let drawn = lacuna::math::moments::variance(&draws.pooled(j)).sqrt();
            assert!((drawn / sd - 1.0).abs() < 0.25, "seed {seed}: {drawn} and {sd}");
        }
    }
}

//! `lotka_volterra`: hares and lynxes of the Hudson's Bay Company.

use lacuna::math::distribution::Distribution::{LogNormal, TruncatedNormal};

use super::{Model, Posterior, Real, file, normal, normal_prior, positive};

/// Point: alpha, beta, gamma, delta, both initial populations, both errors of the logarithms.
struct Populations {
    initial: Vec<f64>,
    /// One row per year from the first.
    counts: Vec<Vec<f64>>,
}

/// Steps of the fourth-order Runge-Kutta method per year: the error is far below the tolerances of the reference.
const STEPS: usize = 32;

impl Model for Populations {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let (theta, start, sigma) = (&point[..4], &point[4..6], &point[6..8]);
        let mut sum = R::from(0.0);
        for x in point {
            sum = sum + positive(*x);
        }
        for (k, rate) in theta.iter().enumerate() {
            let (mean, sd) = if k % 2 == 0 { (1.0, 0.5) } else { (0.05, 0.05) };
            sum = sum + normal_prior(*rate, mean, sd);
        }
        for k in 0..2 {
            sum = sum + log_normal(sigma[k], -1.0, 1.0) + log_normal(start[k], 10f64.ln(), 1.0);
            sum = sum + normal(R::from(self.initial[k].ln()), start[k].ln(), sigma[k]);
        }
        let mut state = [start[0], start[1]];
        for counts in &self.counts {
            for _ in 0..STEPS {
                state = step(theta, state);
            }
            for k in 0..2 {
                sum = sum + normal(R::from(counts[k].ln()), state[k].ln(), sigma[k]);
            }
        }
        sum
    }
}

/// Logarithm of a log-normal density, without its constant.
fn log_normal<R: Real>(x: R, mu: f64, sigma: f64) -> R {
    normal_prior(x.ln(), mu, sigma) - x.ln()
}

fn step<R: Real>(theta: &[R], z: [R; 2]) -> [R; 2] {
    let h = R::from(1.0 / STEPS as f64);
    let rate = |[u, v]: [R; 2]| [(theta[0] - theta[1] * v) * u, (theta[3] * u - theta[2]) * v];
    let moved = |by: R, k: [R; 2]| [z[0] + by * k[0], z[1] + by * k[1]];
    let half = h * R::from(0.5);
    let a = rate(z);
    let b = rate(moved(half, a));
    let c = rate(moved(half, b));
    let d = rate(moved(h, c));
    let two = R::from(2.0);
    let mean = |k: usize| (a[k] + two * b[k] + two * c[k] + d[k]) / R::from(6.0);
    moved(h, [mean(0), mean(1)])
}

pub(super) fn posterior() -> Posterior {
    let file = file!("hudson_lynx_hare-lotka_volterra");
    let model = Populations { initial: file.vector("y_init"), counts: file.rows("y") };
    let rate = |mean: f64, sd: f64| TruncatedNormal([mean, sd, 0.0, f64::INFINITY]);
    let ten = LogNormal([10f64.ln(), 1.0]);
    let error = LogNormal([-1.0, 1.0]);
    let starts = vec![
        ("alpha", rate(1.0, 0.5)),
        ("beta", rate(0.05, 0.05)),
        ("gamma", rate(1.0, 0.5)),
        ("delta", rate(0.05, 0.05)),
        ("hares", ten.clone()),
        ("lynxes", ten),
        ("sigma_hares", error.clone()),
        ("sigma_lynxes", error),
    ];
    file.posterior(model, starts)
}

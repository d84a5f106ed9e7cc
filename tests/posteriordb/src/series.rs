//! Time series: `arK` (autoregression of order five), `arma11`, `garch11`.

use lacuna::math::distribution::Distribution::{HalfNormal, Normal, Uniform};

use super::{Model, Posterior, Real, file, half_cauchy, normal, normal_prior, positive};

pub(super) fn posteriors() -> Vec<Posterior> {
    vec![autoregression(), moving_average(), volatility()]
}

/// `y_t ~ N(alpha + sum beta_k y_(t-k), sigma)`; point: alpha, beta, sigma.
struct Autoregression(Vec<f64>);

impl Model for Autoregression {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let (alpha, beta, sigma) = (point[0], &point[1..6], point[6]);
        let mut sum = normal_prior(alpha, 0.0, 10.0) + half_cauchy(sigma, 2.5);
        for b in beta {
            sum = sum + normal_prior(*b, 0.0, 10.0);
        }
        for t in beta.len()..self.0.len() {
            let past = beta.iter().enumerate();
            let mean = past.fold(alpha, |mean, (k, b)| mean + *b * R::from(self.0[t - 1 - k]));
            sum = sum + normal(R::from(self.0[t]), mean, sigma);
        }
        sum
    }
}

fn autoregression() -> Posterior {
    let file = file!("arK-arK");
    let model = Autoregression(file.vector("y"));
    let mut starts = vec![("alpha", Normal([0.0, 1.0]))];
    starts.extend(
        ["beta_1", "beta_2", "beta_3", "beta_4", "beta_5"].map(|n| (n, Normal([0.0, 0.5]))),
    );
    starts.push(("sigma", HalfNormal(1.0)));
    file.posterior(model, starts)
}

/// Point: mu, phi, theta, sigma. Before the first time the error is zero and the value mu.
struct MovingAverage(Vec<f64>);

impl Model for MovingAverage {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let &[mu, phi, theta, sigma] = point else { unreachable!("four unknowns") };
        let mut sum = normal_prior(mu, 0.0, 10.0)
            + normal_prior(phi, 0.0, 2.0)
            + normal_prior(theta, 0.0, 2.0)
            + half_cauchy(sigma, 2.5);
        let (mut last, mut error) = (mu, R::from(0.0));
        for y in &self.0 {
            error = R::from(*y) - (mu + phi * last + theta * error);
            sum = sum + normal(error, R::from(0.0), sigma);
            last = R::from(*y);
        }
        sum
    }
}

fn moving_average() -> Posterior {
    let file = file!("arma-arma11");
    let model = MovingAverage(file.vector("y"));
    let starts = vec![
        ("mu", Normal([0.0, 1.0])),
        ("phi", Normal([0.0, 1.0])),
        ("theta", Normal([0.0, 1.0])),
        ("sigma", HalfNormal(1.0)),
    ];
    file.posterior(model, starts)
}

/// Point: mu, alpha0, alpha1, beta1; `sigma_t^2 = alpha0 + alpha1 (y_(t-1) - mu)^2 + beta1 sigma_(t-1)^2`.
struct Volatility {
    y: Vec<f64>,
    first: f64,
}

impl Model for Volatility {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let &[mu, alpha0, alpha1, beta1] = point else { unreachable!("four unknowns") };
        let room = R::from(1.0) - alpha1 - beta1;
        let mut sum = positive(alpha0) + positive(alpha1) + positive(beta1) + positive(room);
        let mut variance = R::from(self.first * self.first);
        for y in &self.y {
            let rest = R::from(*y) - mu;
            sum = sum + normal(rest, R::from(0.0), variance.sqrt());
            variance = alpha0 + alpha1 * rest * rest + beta1 * variance;
        }
        sum
    }
}

fn volatility() -> Posterior {
    let file = file!("garch-garch11");
    let model = Volatility { y: file.vector("y"), first: file.number("sigma1") };
    let starts = vec![
        ("mu", Normal([0.0, 10.0])),
        ("alpha0", HalfNormal(3.0)),
        ("alpha1", Uniform([0.0, 1.0])),
        ("beta1", Uniform([0.0, 1.0])),
    ];
    file.posterior(model, starts)
}

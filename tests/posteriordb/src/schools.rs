//! `eight_schools_noncentered`: Rubin's eight schools, with standardised effects.

use lacuna::math::distribution::Distribution::{HalfNormal, Normal};

use super::{Model, Posterior, Real, file, half_cauchy, normal, normal_prior};

/// Point: the standardised effects, mu, tau.
struct Schools {
    y: Vec<f64>,
    sigma: Vec<f64>,
}

impl Model for Schools {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let (effects, mu, tau) = (&point[..8], point[8], point[9]);
        let mut sum = normal_prior(mu, 0.0, 5.0) + half_cauchy(tau, 5.0);
        for ((y, sigma), effect) in self.y.iter().zip(&self.sigma).zip(effects) {
            let theta = *effect * tau + mu;
            sum =
                sum + normal_prior(*effect, 0.0, 1.0) + normal(R::from(*y), theta, R::from(*sigma));
        }
        sum
    }
}

const EFFECTS: [&str; 8] = [
    "effect_1", "effect_2", "effect_3", "effect_4", "effect_5", "effect_6", "effect_7", "effect_8",
];

pub(super) fn posterior() -> Posterior {
    let file = file!("eight_schools-eight_schools_noncentered");
    let model = Schools { y: file.vector("y"), sigma: file.vector("sigma") };
    let mut starts = EFFECTS.map(|name| (name, Normal([0.0, 1.0]))).to_vec();
    starts.extend([("mu", Normal([0.0, 5.0])), ("tau", HalfNormal(5.0))]);
    // The published quantities are the effects themselves.
    let reported = |point: &[f64]| {
        let (mu, tau) = (point[8], point[9]);
        point[..8].iter().map(|effect| effect * tau + mu).chain([mu, tau]).collect()
    };
    Posterior { reported, ..file.posterior(model, starts) }
}

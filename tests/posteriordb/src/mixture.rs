//! `low_dim_gauss_mix`: a mixture of two normal distributions, the lower mean first.

use lacuna::math::distribution::Distribution::{Beta, HalfNormal, Normal};

use super::{Model, Posterior, Real, file, normal, normal_prior, positive};

/// Point: both means, both standard deviations, the weight of the first component.
struct Mixture(Vec<f64>);

impl Model for Mixture {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let &[first, second, sd_first, sd_second, share] = point else {
            unreachable!("five unknowns")
        };
        let rest = R::from(1.0) - share;
        let mut sum = positive(second - first) + positive(sd_first) + positive(sd_second);
        // Beta(5, 5).
        sum = sum + (share.ln() + rest.ln()) * R::from(4.0);
        for x in [first, second, sd_first, sd_second] {
            sum = sum + normal_prior(x, 0.0, 2.0);
        }
        for y in &self.0 {
            let y = R::from(*y);
            let one = share.ln() + normal(y, first, sd_first);
            let other = rest.ln() + normal(y, second, sd_second);
            let (large, small) =
                if one.number() > other.number() { (one, other) } else { (other, one) };
            sum = sum + large + ((small - large).exp() + R::from(1.0)).ln();
        }
        sum
    }
}

pub(super) fn posterior() -> Posterior {
    let file = file!("low_dim_gauss_mix-low_dim_gauss_mix");
    let model = Mixture(file.vector("y"));
    let starts = vec![
        ("mu_1", Normal([0.0, 2.0])),
        ("mu_2", Normal([0.0, 2.0])),
        ("sigma_1", HalfNormal(2.0)),
        ("sigma_2", HalfNormal(2.0)),
        ("theta", Beta([5.0, 5.0, 0.0, 1.0])),
    ];
    file.posterior(model, starts)
}

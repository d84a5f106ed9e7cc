//! Archimedean copulas of two numbers (Nelsen, An Introduction to Copulas (2006), table 4.1; Joe, Dependence Modeling with
//! Copulas (2014), sections 4.4 to 4.8).

use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::distribution::Distribution;
use crate::math::random::uniform;
use crate::math::special::{
    HALF_LN_TWO_PI, five_point_rule, ln_normal_cdf, ln_sum_exp, normal_quantile,
};

/// A family of Archimedean copulas with one parameter, theta.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// Clayton: dependence in the lower tail; theta above 0.
    Clayton,
    /// Gumbel: dependence in the upper tail; theta from 1.
    Gumbel,
    /// Frank: symmetric, without dependence in the tails; theta of either sign, not 0.
    Frank,
}

impl Family {
    /// Kendall's tau of the copula with this theta.
    pub fn kendall(self, theta: f64) -> f64 {
        match self {
            Self::Clayton => theta / (theta + 2.0),
            Self::Gumbel => 1.0 - 1.0 / theta,
            Self::Frank => 1.0 - 4.0 / theta * (1.0 - debye(theta)),
        }
    }

    /// Theta of the copula with this value of Kendall's tau; `None` if the family has none with it.
    pub fn theta(self, kendall: f64) -> Option<f64> {
        if kendall.is_nan() || kendall.abs() >= 1.0 || kendall == 0.0 {
            return None;
        }
        match self {
            Self::Clayton if kendall > 0.0 => Some(2.0 * kendall / (1.0 - kendall)),
            Self::Gumbel if kendall > 0.0 => Some(1.0 / (1.0 - kendall)),
            Self::Frank => {
                let (mut low, mut high) = (0.0, 1.0);
                while self.kendall(high) < kendall.abs() {
                    high *= 2.0;
                }
                for _ in 0..100 {
                    let middle = 0.5 * (low + high);
                    let below = self.kendall(middle) < kendall.abs();
                    if below { low = middle } else { high = middle }
                }
                Some(0.5 * (low + high) * kendall.signum())
            }
            _ => None,
        }
    }

    /// Values of theta that the family allows, in words.
    pub fn range(self) -> &'static str {
        match self {
            Self::Clayton => "a number above 0, at most 100",
            Self::Gumbel => "a number from 1 to 50",
            Self::Frank => "a number from -200 to 200, not 0",
        }
    }

    /// True if the family has a copula with this theta. Beyond the limits the two numbers are equal to rounding.
    pub fn allows(self, theta: f64) -> bool {
        match self {
            Self::Clayton => theta > 0.0 && theta <= 100.0,
            Self::Gumbel => (1.0..=50.0).contains(&theta),
            Self::Frank => theta != 0.0 && theta.abs() <= 200.0,
        }
    }

    /// Logarithm of the copula density at two normal scores.
    pub(super) fn log_density(self, theta: f64, z: [f64; 2]) -> f64 {
        let l = z.map(ln_normal_cdf);
        match self {
            Self::Clayton => {
                theta.ln_1p()
                    - (1.0 + theta) * (l[0] + l[1])
                    - (2.0 + 1.0 / theta) * clayton(theta, l)
            }
            Self::Gumbel => {
                let ([x, y], a) = gumbel(theta, l);
                x + y - a
                    + (1.0 - 2.0 * theta) * a.ln()
                    + (theta - 1.0) * (x.ln() + y.ln())
                    + (a + theta - 1.0).ln()
            }
            Self::Frank => {
                let u = l.map(f64::exp);
                let (constant, denominator, _) = frank(theta, u);
                (theta * constant).ln() - theta * (u[0] + u[1]) - 2.0 * denominator.abs().ln()
            }
        }
    }

    /// Derivatives of the log density by the normal scores.
    pub(super) fn slopes(self, theta: f64, z: [f64; 2]) -> [f64; 2] {
        let l = z.map(ln_normal_cdf);
        // Derivatives by ln u, and that of ln u by the score.
        let by_ln = match self {
            Self::Clayton => {
                let s = clayton(theta, l);
                l.map(|l| (2.0 * theta + 1.0) * (-theta * l - s).exp() - (1.0 + theta))
            }
            Self::Gumbel => {
                let (x, a) = gumbel(theta, l);
                let by_a = (1.0 - 2.0 * theta) / a + 1.0 / (a + theta - 1.0) - 1.0;
                x.map(|x| -(by_a * (x / a).powf(theta - 1.0) + 1.0 + (theta - 1.0) / x))
            }
            Self::Frank => {
                let u = l.map(f64::exp);
                let (_, denominator, rest) = frank(theta, u);
                let of = |i: usize| {
                    let slope = -theta * (-theta * u[i]).exp() * rest[1 - i];
                    (-theta - 2.0 * slope / denominator) * u[i]
                };
                [of(0), of(1)]
            }
        };
        let own = |i: usize| by_ln[i] * (-0.5 * z[i] * z[i] - HALF_LN_TWO_PI - l[i]).exp();
        [own(0), own(1)]
    }

    /// Normal scores of a draw: by the conditional distribution (Clayton, Frank), or with a positive stable variable (Gumbel;
    /// Marshall and Olkin, JASA 83 (1988) 834; Kanter, Annals of Probability 3 (1975) 697).
    pub(super) fn draw(self, theta: f64, rng: &mut impl Rng) -> [f64; 2] {
        let (u, p) = (uniform(rng), uniform(rng));
        let pair = match self {
            Self::Clayton => {
                let inner = (-theta / (1.0 + theta) * p.ln()).exp_m1() * (-theta * u.ln()).exp();
                [u, (-inner.ln_1p() / theta).exp()]
            }
            Self::Frank => {
                let ratio =
                    p * -(-theta).exp_m1() / (p * (-theta * u).exp_m1() - (-theta * u).exp());
                [u, -ratio.ln_1p() / theta]
            }
            Self::Gumbel => {
                let exponential = Distribution::Exponential(1.0);
                let sizes = [exponential.sample(rng), exponential.sample(rng)];
                let (alpha, angle) = (1.0 / theta, std::f64::consts::PI * u);
                let waiting = -p.ln();
                let stable = (alpha * angle).sin() / angle.sin().powf(theta)
                    * (((1.0 - alpha) * angle).sin() / waiting).powf(theta - 1.0);
                sizes.map(|e| (-(e / stable).powf(alpha)).exp())
            }
        };
        pair.map(|u| normal_quantile(u.clamp(f64::MIN_POSITIVE, 1.0 - 0.5 * f64::EPSILON)))
    }
}

/// `ln(u^-theta + v^-theta - 1)` from the logarithms of `u` and `v`.
fn clayton(theta: f64, l: [f64; 2]) -> f64 {
    let [a, b] = l.map(|l| -theta * l);
    let sum = ln_sum_exp(a, b);
    sum + (-(-sum).exp()).ln_1p()
}

/// `-ln u`, `-ln v`, and the `theta`-norm of the two.
fn gumbel(theta: f64, l: [f64; 2]) -> ([f64; 2], f64) {
    let x = l.map(|l| (-l).max(f64::MIN_POSITIVE));
    let (large, small) = (x[0].max(x[1]), x[0].min(x[1]));
    (x, large * ((small / large).powf(theta).ln_1p() / theta).exp())
}

/// `1 - e^-theta`, the root of the denominator of the density, and `1 - e^(-theta u)` of both.
fn frank(theta: f64, u: [f64; 2]) -> (f64, f64, [f64; 2]) {
    let constant = -(-theta).exp_m1();
    let rest = u.map(|u| -(-theta * u).exp_m1());
    (constant, constant - rest[0] * rest[1], rest)
}

/// Debye's function of order one: `1/x` times the integral of `t / (e^t - 1)` from 0 to `x`.
fn debye(x: f64) -> f64 {
    let panels = (x.abs().ceil() as u32).clamp(8, 400);
    let width = x / f64::from(panels);
    let integrand = |t: f64| if t == 0.0 { 1.0 } else { t / t.exp_m1() };
    let panel = |k: u32| {
        let nodes = five_point_rule();
        let at = |node: f64| width * (f64::from(k) + 0.5 * (1.0 + node));
        nodes.iter().map(|&(node, weight)| weight * integrand(at(node))).sum::<f64>()
    };
    0.5 * (0..panels).map(panel).sum::<f64>() / f64::from(panels)
}

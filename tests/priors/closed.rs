//! A straight line with normal noise and a bivariate normal prior, in closed form.

/// `y = a + b x` plus noise, and the prior of `a` and `b`.
pub struct Linear {
    pub mean: [f64; 2],
    pub sd: [f64; 2],
    pub rho: f64,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub noise: f64,
}

pub struct Exact {
    pub mean: [f64; 2],
    pub sd: [f64; 2],
    pub log_evidence: f64,
}

type Symmetric = [f64; 3];

fn inverse([a, b, c]: Symmetric) -> Symmetric {
    let determinant = a * c - b * b;
    [c / determinant, -b / determinant, a / determinant]
}

fn quadratic([a, b, c]: Symmetric, [x, y]: [f64; 2]) -> f64 {
    a * x * x + 2.0 * b * x * y + c * y * y
}

/// Log density of a bivariate normal distribution with this precision, at a distance from its mean.
fn log_density(precision: Symmetric, from_mean: [f64; 2]) -> f64 {
    let [a, b, c] = precision;
    0.5 * (a * c - b * b).ln() - std::f64::consts::TAU.ln() - 0.5 * quadratic(precision, from_mean)
}

impl Linear {
    pub fn log_likelihood(&self) -> String {
        let one =
            |(x, y): (&f64, &f64)| format!("normal_log_density({y}, a + b * {x}, {})", self.noise);
        self.x.iter().zip(&self.y).map(one).collect::<Vec<_>>().join(" + ")
    }

    fn prior_precision(&self) -> Symmetric {
        let [s, t] = self.sd;
        inverse([s * s, self.rho * s * t, t * t])
    }

    pub fn posterior(&self) -> Exact {
        let prior = self.prior_precision();
        let weight = self.noise.powi(-2);
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            weight * self.x.iter().zip(&self.y).map(|(&x, &y)| f(x, y)).sum::<f64>()
        };
        let [p, q, r] = prior;
        let precision = [p + sum(&|_, _| 1.0), q + sum(&|x, _| x), r + sum(&|x, _| x * x)];
        let [m, n] = self.mean;
        let right = [p * m + q * n + sum(&|_, y| y), q * m + r * n + sum(&|x, y| x * y)];
        let covariance = inverse(precision);
        let [a, b, c] = covariance;
        let mean = [a * right[0] + b * right[1], b * right[0] + c * right[1]];
        let likelihood: f64 = self
            .x
            .iter()
            .zip(&self.y)
            .map(|(x, y)| {
                let z = (y - mean[0] - mean[1] * x) / self.noise;
                -0.5 * z * z - self.noise.ln() - 0.5 * std::f64::consts::TAU.ln()
            })
            .sum();
        // p(y) = p(y | theta) p(theta) / p(theta | y), at the mean of the posterior.
        let log_evidence = likelihood + log_density(prior, [mean[0] - m, mean[1] - n])
            - log_density(precision, [0.0, 0.0]);
        Exact { mean, sd: [a.sqrt(), c.sqrt()], log_evidence }
    }
}

//! `gp_regr`: a Gaussian process with a squared exponential kernel.

use lacuna::math::distribution::Distribution::{Gamma, HalfNormal};

use super::{Model, Posterior, Real, file, normal_prior, positive};

/// Point: length scale rho, amplitude alpha, and sigma, which is added to the diagonal without squaring.
struct Process {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Model for Process {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let &[rho, alpha, sigma] = point else { unreachable!("three unknowns") };
        // Gamma with shape 25 and rate 4.
        let mut sum = rho.ln() * R::from(24.0) - rho * R::from(4.0)
            + normal_prior(alpha, 0.0, 2.0)
            + normal_prior(sigma, 0.0, 1.0)
            + positive(rho)
            + positive(alpha)
            + positive(sigma);
        let covariance = |i: usize, j: usize| {
            let distance = R::from(self.x[i] - self.x[j]) / rho;
            let kernel = alpha * alpha * (distance * distance * R::from(-0.5)).exp();
            if i == j { kernel + sigma } else { kernel }
        };
        // Cholesky factor row by row, and the whitened data along the way.
        let mut factor: Vec<Vec<R>> = Vec::new();
        let mut white: Vec<R> = Vec::new();
        for i in 0..self.x.len() {
            let mut row: Vec<R> = Vec::with_capacity(i + 1);
            for j in 0..=i {
                let above = if j < i { &factor[j][..] } else { &row[..] };
                let products = row.iter().zip(above).take(j);
                let rest = products.fold(covariance(i, j), |rest, (a, b)| rest - *a * *b);
                let entry = if i == j { rest.sqrt() } else { rest / above[j] };
                row.push(entry);
            }
            let products = row.iter().zip(&white);
            let rest = products.fold(R::from(self.y[i]), |rest, (a, b)| rest - *a * *b);
            let z = rest / row[i];
            sum = sum - z * z * R::from(0.5) - row[i].ln();
            white.push(z);
            factor.push(row);
        }
        sum
    }
}

pub(super) fn posterior() -> Posterior {
    let file = file!("gp_pois_regr-gp_regr");
    let model = Process { x: file.vector("x"), y: file.vector("y") };
    let starts =
        vec![("rho", Gamma([25.0, 0.25])), ("alpha", HalfNormal(2.0)), ("sigma", HalfNormal(1.0))];
    file.posterior(model, starts)
}

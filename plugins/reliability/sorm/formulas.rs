//! Probabilities beyond a paraboloid.

use lacuna::math::special::normal_cdf;

use super::Formula;

/// Probability beyond a paraboloid at the distance `beta` with these principal curvatures; `None` if the paraboloid does
/// not have its nearest point there.
pub fn probability(formula: Formula, beta: f64, curvatures: &[f64]) -> Option<f64> {
    let tail = normal_cdf(-beta);
    let density = (-0.5 * beta * beta).exp() / std::f64::consts::TAU.sqrt();
    let found = match formula {
        Formula::Breitung => tail * product(beta, curvatures)?,
        Formula::HohenbichlerRackwitz => tail * product(density / tail, curvatures)?,
        Formula::Tvedt => {
            let first = product(beta, curvatures)?;
            let second = product(beta + 1.0, curvatures)?;
            let third = real_product(beta, curvatures);
            let lever = beta * tail - density;
            tail * first + lever * (first - second) + (beta + 1.0) * lever * (first - third)
        }
    };
    (found > 0.0 && found.is_finite()).then_some(found.min(1.0))
}

/// Product of `(1 + beta k)^(-1/2)`.
fn product(beta: f64, curvatures: &[f64]) -> Option<f64> {
    let factors = curvatures.iter().map(|k| 1.0 + beta * k);
    let product: f64 = factors.clone().product();
    factors.into_iter().all(|f| f > 0.0).then(|| product.powf(-0.5))
}

/// Real part of the product of `(1 + (beta + i) k)^(-1/2)`.
fn real_product(beta: f64, curvatures: &[f64]) -> f64 {
    let (mut ln_size, mut angle) = (0.0, 0.0);
    for k in curvatures {
        let (re, im) = (1.0 + beta * k, *k);
        ln_size -= 0.5 * re.hypot(im).ln();
        angle -= 0.5 * im.atan2(re);
    }
    ln_size.exp() * angle.cos()
}

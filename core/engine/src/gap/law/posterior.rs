//! The posterior of the weights of a force in a linearised problem.

use lacuna::math::distribution::Distribution;
use lacuna_linalg::{
    Cholesky, Matrix, gram, multiply_vector, symmetric_eigen, transposed_multiply_vector,
};

use crate::gap::system::coordinate::Coordinate;

/// The number of sizes that are tried, from a thousandth to a hundred times a unit.
const SIZES: usize = 31;

/// The linearised problem at a point, whitened.
pub(super) struct Linear {
    /// The residual to which the force that is there is added back, and the slopes of the unknowns, `unknowns x
    /// outputs`.
    pub residual: Vec<f64>,
    pub slopes: Matrix,
    /// The priors of the unknowns about the point; the residual is that at their centres.
    pub pull: Pull,
    /// The responses to all weights, `weights x outputs`, and their products in the metric.
    pub directions: Matrix,
    pub information: Matrix,
    pub score: Vec<f64>,
}

impl Linear {
    /// The shift of the unknowns beside these weights.
    pub fn shift(&self, mean: &[f64]) -> Vec<f64> {
        let force = transposed_multiply_vector(&self.directions, mean);
        let left: Vec<f64> = self.residual.iter().zip(force).map(|(z, f)| z - f).collect();
        let mut shift = multiply_vector(&self.slopes, &left);
        let mut inner = gram(&self.slopes.transposed());
        let scale: Vec<f64> = self.pull.precisions.iter().map(|p| 1.0 / p.sqrt()).collect();
        let scaled = Matrix::from_fn(inner.rows(), inner.rows(), |i, j| {
            scale[i] * inner[(i, j)] * scale[j] + f64::from(u8::from(i == j))
        });
        inner = scaled;
        shift.iter_mut().zip(&scale).for_each(|(x, s)| *x *= s);
        match Cholesky::new(&inner) {
            Ok(factor) => factor.solve(&mut shift),
            Err(_) => shift.fill(0.0),
        }
        shift.iter_mut().zip(&scale).for_each(|(x, s)| *x *= s);
        shift.iter_mut().zip(&self.pull.shifts).for_each(|(x, s)| *x += s);
        shift
    }
}

/// The priors of unknowns about a point, as normal distributions.
pub(super) struct Pull {
    /// The precisions.
    pub precisions: Vec<f64>,
    /// The shifts from the point to the centres.
    pub shifts: Vec<f64>,
}

impl Pull {
    /// The priors about a point, with the slopes and widths of the coordinates in which a fit searches.
    pub fn of(priors: &[Distribution], point: &[f64]) -> Self {
        let each = priors.iter().zip(point).map(|(prior, &x)| {
            let coordinate = Coordinate::of(prior);
            let precision = coordinate.unit(x).powi(-2);
            (precision, coordinate.slope(x) / precision)
        });
        let (precisions, shifts) = each.unzip();
        Self { precisions, shifts }
    }

    /// A whitened residual at the point as one at the centres, by linearisation.
    pub fn centred(&self, residual: &[f64], slopes: &Matrix) -> Vec<f64> {
        let moved = transposed_multiply_vector(slopes, &self.shifts);
        residual.iter().zip(moved).map(|(z, m)| z - m).collect()
    }
}

/// The posterior of the weights.
pub(super) struct Posterior {
    pub mean: Vec<f64>,
    pub root: Matrix,
    pub variances: Vec<f64>,
    pub log_evidence: f64,
}

/// The posterior with these widths of the prior at size one and the size of largest evidence, around `unit`.
pub(super) fn with_widths(linear: &Linear, width: &[f64], unit: f64) -> Option<Posterior> {
    let n = width.len();
    let scaled = Matrix::from_fn(n, n, |i, j| width[i] * linear.information[(i, j)] * width[j]);
    let eigen = symmetric_eigen(&scaled).ok()?;
    let score: Vec<f64> = linear.score.iter().zip(width).map(|(b, w)| b * w).collect();
    let along = transposed_multiply_vector(&eigen.vectors, &score);
    let evidence = |square: f64| -> f64 {
        let each = eigen.values.iter().zip(&along).map(|(l, b)| {
            let grown = square * l.max(0.0);
            0.5 * (square * b * b / (1.0 + grown) - grown.ln_1p())
        });
        each.sum()
    };
    let sizes = (0..SIZES).map(|k| {
        let size = unit * 10f64.powf(-3.0 + 5.0 * k as f64 / (SIZES - 1) as f64);
        (size * size, evidence(size * size))
    });
    let best = sizes.fold(None, |best: Option<(f64, f64)>, next| match best {
        Some(best) if best.1 >= next.1 => Some(best),
        _ => Some(next),
    });
    let (square, log_evidence) = best?;
    let spread: Vec<f64> =
        eigen.values.iter().map(|l| square / (1.0 + square * l.max(0.0))).collect();
    let inner: Vec<f64> = spread.iter().zip(&along).map(|(s, b)| s * b).collect();
    let mean = multiply_vector(&eigen.vectors, &inner);
    let mean = mean.iter().zip(width).map(|(m, w)| m * w).collect();
    let root =
        Matrix::from_fn(n, n, |i, a| width[i] * eigen.vectors[(i, a)] * spread[a].max(0.0).sqrt());
    let variances = width.iter().map(|w| square * w * w).collect();
    Some(Posterior { mean, root, variances, log_evidence })
}

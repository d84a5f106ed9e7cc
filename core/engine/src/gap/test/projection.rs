//! The projection off the slopes of the calibrated unknowns: the part of a whitened difference that calibration cannot
//! absorb.

use lacuna_linalg::{
    Matrix, multiply, multiply_transposed, multiply_vector, thin_qr, transposed_multiply_vector,
};

use crate::gap::system::System;
use crate::gap::system::fit::{Fit, precision};

/// The orthogonal projection of `(whitened outputs, prior)` off the slopes of a fit.
///
/// The column `(J, P^1/2)` of an unknown (slopes of the response, square root of the prior's precision) is the change
/// of the residual and of the prior term by a shift of that unknown; the part of a vector orthogonal to all columns is
/// what no shift that the prior allows can explain.
#[derive(Debug, Clone)]
pub struct Projection {
    /// The part of an orthonormal basis of the slopes that lies in the outputs, `outputs x unknowns`.
    basis: Matrix,
}

impl Projection {
    /// The projection off the slopes of a fit, with the precisions of its priors.
    pub fn of(system: &System<'_>, fit: &Fit) -> Self {
        Self::off(&fit.slopes, &system.priors().iter().map(precision).collect::<Vec<_>>())
    }

    /// The projection off whitened slopes, `unknowns x outputs`, with the precisions of the priors in inverse squares
    /// of the unknowns' units.
    pub fn off(slopes: &Matrix, precisions: &[f64]) -> Self {
        let (unknowns, outputs) = (slopes.rows(), slopes.columns());
        if unknowns == 0 {
            return Self { basis: Matrix::zeros(outputs, 0) };
        }
        // In units of the priors' widths all columns are of comparable length.
        let augmented = Matrix::from_fn(outputs + unknowns, unknowns, |i, j| {
            let root = precisions[j].sqrt();
            if i < outputs { slopes[(j, i)] / root } else { f64::from(u8::from(i - outputs == j)) }
        });
        let rows: Vec<usize> = (0..outputs).collect();
        match thin_qr(&augmented) {
            Ok(qr) => Self { basis: qr.q.select_rows(&rows) },
            Err(_) => Self { basis: Matrix::zeros(outputs, 0) },
        }
    }

    /// The projection of a whitened vector, one value an output.
    pub fn rest(&self, white: &[f64]) -> Vec<f64> {
        let along = transposed_multiply_vector(&self.basis, white);
        let taken = multiply_vector(&self.basis, &along);
        white.iter().zip(taken).map(|(w, t)| w - t).collect()
    }

    /// The projections of the rows of a matrix, `rows x outputs`, and for each its squared length with the part that
    /// the priors penalise.
    pub fn rest_of_rows(&self, mut rows: Matrix) -> (Matrix, Vec<f64>) {
        let along = multiply(&rows, &self.basis);
        let square = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>();
        let left = rows.iter_rows().zip(along.iter_rows()).map(|(r, a)| square(r) - square(a));
        let left = left.collect();
        let taken = multiply_transposed(&along, &self.basis);
        rows.as_mut_slice().iter_mut().zip(taken.as_slice()).for_each(|(r, t)| *r -= t);
        (rows, left)
    }
}

//! Prior covariance of the bias.
//!
//! Each series has its own block `C_s`. With `G` an orthonormal basis of the derivatives with respect to the
//! parameters, the prior orthogonal to them is `C - H S^-1 H'` with `H = C G` and `S = G' C G`.

use lacuna::run::Stop;
use lacuna_linalg::{Cholesky, Matrix};

use super::Kernel;
use crate::discrepancies::common::{Block, PerGroup, Replicates};

/// Bias of all series.
#[derive(Debug, Clone)]
pub(super) struct Bias {
    pub kernel: Kernel,
    pub blocks: Vec<Block>,
    /// Values of the axis of a complete series.
    pub grid: Vec<f64>,
    /// `G` at the measured outputs; without columns if the bias need not be orthogonal.
    pub basis: Matrix,
    pub sd: PerGroup,
    pub length: PerGroup,
}

/// Returns an orthonormal basis of the derivatives with respect to the parameters at the measured outputs. `slopes`
/// is `outputs x parameters`.
pub(super) fn basis(slopes: &Matrix, replicates: &Replicates) -> Result<Matrix, Stop> {
    let measured = slopes.select_rows(&replicates.measured);
    let failed = |e| Stop::new(format!("the slopes of the model at the best fit: {e}"));
    let svd = lacuna_linalg::thin_svd(&measured).map_err(failed)?;
    let largest = svd.values.first().copied().unwrap_or(0.0);
    // A parameter without effect defines no direction.
    let rank = svd.values.iter().filter(|&&s| s > 1e-8 * largest).count();
    Ok(svd.u.select_columns(&(0..rank).collect::<Vec<_>>()))
}

impl Bias {
    /// Returns the standard deviation and the correlation length of each group; `None` if one is not above zero.
    pub fn values<'a>(&'a self, hyper: &'a [f64]) -> Option<(&'a [f64], &'a [f64])> {
        Some((self.sd.values(hyper)?, self.length.values(hyper)?))
    }

    /// Returns for each series the covariance at its measured outputs and its derivative with respect to the length;
    /// `None` for a series that has an earlier twin.
    pub fn covariances(&self, values: (&[f64], &[f64])) -> Vec<Option<[Matrix; 2]>> {
        let one = |block: &Block| {
            let (sd, length) = block.of(values);
            block.twin.is_none().then(|| self.along(&block.grid, sd, length))
        };
        self.blocks.iter().map(one).collect()
    }

    /// Returns the covariance and its derivative along one grid. `exp(-x)` of a distance is the product of those of
    /// its steps, which saves most exponentials.
    fn along(&self, grid: &[f64], sd: f64, length: f64) -> [Matrix; 2] {
        let (n, rate) = (grid.len(), self.kernel.rate(length));
        let (mut covariance, mut slope) = (Matrix::zeros(n, n), Matrix::zeros(n, n));
        let mut decays: Vec<f64> = Vec::with_capacity(n);
        for i in 0..n {
            let step = if i == 0 { 0.0 } else { (-rate * (grid[i] - grid[i - 1])).exp() };
            for e in &mut decays {
                *e *= step;
            }
            decays.push(sd * sd);
            for (j, &e) in decays.iter().enumerate() {
                let (value, by_length) = self.kernel.factors(rate * (grid[i] - grid[j]));
                covariance[(i, j)] = value * e;
                covariance[(j, i)] = value * e;
                slope[(i, j)] = by_length * e / length;
                slope[(j, i)] = by_length * e / length;
            }
        }
        [covariance, slope]
    }

    /// Returns the covariances that belong to a series.
    pub fn of<'a>(&self, all: &'a [Option<[Matrix; 2]>], series: usize) -> Option<&'a [Matrix; 2]> {
        all[self.blocks[series].twin.unwrap_or(series)].as_ref()
    }

    /// Returns the covariance between two sets of values of the axis.
    pub fn covariance(&self, rows: &[f64], columns: &[f64], sd: f64, length: f64) -> Matrix {
        Matrix::from_fn(rows.len(), columns.len(), |i, j| {
            sd * sd * self.kernel.at((rows[i] - columns[j]).abs(), length).0
        })
    }

    /// Returns `G` at the measured outputs of a series.
    pub fn basis_of(&self, block: &Block) -> Matrix {
        self.basis.select_rows(&block.rows)
    }

    /// Returns the Cholesky factor of `S = sum_s G_s' H_s`; `None` if it is singular.
    pub fn inner(&self, images: &[Matrix]) -> Option<Cholesky> {
        let p = self.basis.columns();
        let mut inner = Matrix::zeros(p, p);
        for (block, image) in self.blocks.iter().zip(images) {
            let part = lacuna_linalg::transposed_multiply(&self.basis_of(block), image);
            add(&mut inner, 1.0, &part);
        }
        Cholesky::new(&inner).ok()
    }

    /// Returns `H` at the measured outputs, given the covariances.
    pub fn image(&self, covariances: &[Option<[Matrix; 2]>]) -> Matrix {
        let mut image = Matrix::zeros(self.basis.rows(), self.basis.columns());
        for (s, block) in self.blocks.iter().enumerate() {
            let Some([covariance, _]) = self.of(covariances, s) else { continue };
            let own = lacuna_linalg::multiply(covariance, &self.basis_of(block));
            for (&row, values) in block.rows.iter().zip(own.iter_rows()) {
                image.row_mut(row).copy_from_slice(values);
            }
        }
        image
    }

    /// Returns `H` at all outputs of each series, and the factor of `S`.
    pub fn projection(&self, values: (&[f64], &[f64])) -> Option<(Vec<Matrix>, Cholesky)> {
        let image = |grid: &[f64], block: &Block| {
            let (sd, length) = block.of(values);
            lacuna_linalg::multiply(
                &self.covariance(grid, &block.grid, sd, length),
                &self.basis_of(block),
            )
        };
        let measured: Vec<Matrix> = self.blocks.iter().map(|b| image(&b.grid, b)).collect();
        let all = self.blocks.iter().map(|b| image(&self.grid, b)).collect();
        Some((all, self.inner(&measured)?))
    }
}

/// Adds `factor * part` to `sum`.
pub(super) fn add(sum: &mut Matrix, factor: f64, part: &Matrix) {
    let entries = sum.as_mut_slice().iter_mut().zip(part.as_slice());
    entries.for_each(|(s, p)| *s += factor * p);
}

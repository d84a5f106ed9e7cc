//! The scaled process of each series.
//!
//! With `c = n / λ` and `T = (R + c I)^-1` the correlations at the measured outputs are `K = c R T`, and
//!
//! ```text
//! dK = c² T dR T,   dK/dc = (R T)².
//! ```

use lacuna::math::random::Stream;
use lacuna::plugin::Fact;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply};

use crate::discrepancies::common::{
    Bias, Block, Correlation, Functional, Groups, PerGroup, Series, normal_draw,
};

/// Scaling parameter of each series.
pub(super) enum Scaling {
    /// A hundred times the root of the number of measured outputs.
    Root,
    /// Known, or unknown with a prior.
    Stated(PerGroup),
}

/// The scaled bias of all series (see the module).
pub(super) struct ScaledBias {
    kernel: Correlation,
    blocks: Vec<Block>,
    /// Values of the axis of a complete series.
    grid: Vec<f64>,
    measured: usize,
    sd: PerGroup,
    length: PerGroup,
    scaling: Scaling,
}

/// Numbers of one series.
struct Values {
    sd: f64,
    length: f64,
    /// `n / λ`.
    ratio: f64,
}

/// Matrices of one series at its measured outputs.
struct Own {
    by_length: Matrix,
    /// `T`, factored.
    inner: Cholesky,
    /// `R T`.
    kept: Matrix,
}

impl ScaledBias {
    pub fn new(
        kernel: Correlation,
        series: &Series,
        place: &[usize],
        groups: &Groups,
        (sd, length, scaling): (PerGroup, PerGroup, Scaling),
    ) -> Self {
        let blocks = Block::all(series, place, groups);
        let measured = place.iter().filter(|&&k| k != usize::MAX).count();
        Self { kernel, blocks, grid: series.grid.clone(), measured, sd, length, scaling }
    }

    /// Returns the numbers of a series; the means of all groups for one never measured.
    fn values(&self, block: &Block, hyper: &[f64]) -> Option<Values> {
        let n = block.rows.len().max(1) as f64;
        let scaling = match &self.scaling {
            Scaling::Root => 100.0 * n.sqrt(),
            Scaling::Stated(stated) => block.value(stated.values(hyper)?),
        };
        let (sd, length) = block.of((self.sd.values(hyper)?, self.length.values(hyper)?));
        Some(Values { sd, length, ratio: n / scaling })
    }

    fn own(&self, block: &Block, values: &Values) -> Option<Own> {
        let n = block.grid.len();
        let (mut correlation, mut by_length) = (Matrix::zeros(n, n), Matrix::zeros(n, n));
        for (i, &x) in block.grid.iter().enumerate() {
            for (j, &y) in block.grid.iter().enumerate() {
                let (a, b) = (Functional::value(x), Functional::value(y));
                (correlation[(i, j)], by_length[(i, j)]) =
                    self.kernel.covariance(&a, &b, values.length);
            }
        }
        let mut outer = correlation.clone();
        (0..n).for_each(|i| outer[(i, i)] += values.ratio);
        let inner = Cholesky::new(&outer).ok()?;
        let kept = inner.solve_matrix(&correlation).transposed();
        Some(Own { by_length, inner, kept })
    }

    /// Returns the covariance at all outputs of a series.
    fn of_series(&self, block: &Block, values: &Values) -> Option<Matrix> {
        let own = self.own(block, values)?;
        let of = |x: f64, y: f64| {
            self.kernel.covariance(&Functional::value(x), &Functional::value(y), values.length).0
        };
        let (all, n) = (self.grid.len(), block.grid.len());
        let cross = Matrix::from_fn(n, all, |i, j| of(block.grid[i], self.grid[j]));
        let white = own.inner.whiten_matrix(&cross).transposed();
        let square = values.sd * values.sd;
        Some(Matrix::from_fn(all, all, |i, j| {
            square * (of(self.grid[i], self.grid[j]) - dot(white.row(i), white.row(j)))
        }))
    }
}

impl Bias for ScaledBias {
    fn covariance(&self, hyper: &[f64]) -> Option<Matrix> {
        let mut all = Matrix::zeros(self.measured, self.measured);
        for block in self.blocks.iter().filter(|block| !block.rows.is_empty()) {
            let values = self.values(block, hyper)?;
            let own = self.own(block, &values)?;
            let factor = values.sd * values.sd * values.ratio;
            for (i, &a) in block.rows.iter().enumerate() {
                for (j, &b) in block.rows.iter().enumerate() {
                    all[(a, b)] = 0.5 * factor * (own.kept[(i, j)] + own.kept[(j, i)]);
                }
            }
        }
        Some(all)
    }

    fn add_gradient(&self, hyper: &[f64], by_covariance: &Matrix, by_hyper: &mut [f64]) {
        let groups = self.sd.values(hyper).map_or(0, <[f64]>::len);
        let [mut by_sd, mut by_length, mut by_scaling] = [0; 3].map(|_| vec![0.0; groups]);
        for block in self.blocks.iter().filter(|block| !block.rows.is_empty()) {
            let Some((values, g)) = self.values(block, hyper).zip(block.group) else { return };
            let Some(own) = self.own(block, &values) else { return };
            let n = block.rows.len();
            let by = Matrix::from_fn(n, n, |i, j| by_covariance[(block.rows[i], block.rows[j])]);
            let (square, c) = (values.sd * values.sd, values.ratio);
            let along = |change: &Matrix| dot(by.as_slice(), change.as_slice());
            by_sd[g] += 2.0 * values.sd * c * along(&own.kept);
            let half = own.inner.solve_matrix(&own.by_length).transposed();
            by_length[g] += square * c * c * along(&own.inner.solve_matrix(&half));
            let by_ratio = square * along(&multiply(&own.kept, &own.kept));
            by_scaling[g] -= by_ratio * c * c / n as f64;
        }
        self.sd.add_gradient(&by_sd, by_hyper);
        self.length.add_gradient(&by_length, by_hyper);
        if let Scaling::Stated(stated) = &self.scaling {
            stated.add_gradient(&by_scaling, by_hyper);
        }
    }

    fn variance(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let outputs = self.blocks.iter().map(|block| block.outputs.len()).sum();
        let mut variance = vec![0.0; outputs];
        for block in &self.blocks {
            let all = self.of_series(block, &self.values(block, hyper)?)?;
            let own = block.outputs.iter().enumerate();
            own.for_each(|(j, &i)| variance[i] = all[(j, j)].max(0.0));
        }
        Some(variance)
    }

    fn everywhere(&self, hyper: &[f64]) -> Option<Matrix> {
        let outputs = self.blocks.iter().map(|block| block.outputs.len()).sum();
        let mut all = Matrix::zeros(outputs, outputs);
        for block in &self.blocks {
            let own = self.of_series(block, &self.values(block, hyper)?)?;
            for (i, &a) in block.outputs.iter().enumerate() {
                for (j, &b) in block.outputs.iter().enumerate() {
                    all[(a, b)] = own[(i, j)];
                }
            }
        }
        Some(all)
    }

    fn draw(&self, hyper: &[f64], stream: &Stream) -> Option<Vec<f64>> {
        let outputs = self.blocks.iter().map(|block| block.outputs.len()).sum();
        let mut bias = vec![0.0; outputs];
        for (s, block) in self.blocks.iter().enumerate() {
            let own = self.of_series(block, &self.values(block, hyper)?)?;
            let drawn = normal_draw(&vec![0.0; own.rows()], &own, &stream.at(s as u64))?;
            block.outputs.iter().zip(drawn).for_each(|(&i, b)| bias[i] = b);
        }
        Some(bias)
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("series with a bias", self.blocks.len())]
    }
}

//! Conversions between [`Matrix`] and the types of `faer`.

use faer::{MatMut, MatRef, Par};

use crate::Matrix;

/// A view without a copy.
pub(crate) fn view(a: &Matrix) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(a.as_slice(), a.rows(), a.columns())
}

/// A mutable view without a copy.
pub(crate) fn view_mut(a: &mut Matrix) -> MatMut<'_, f64> {
    let (rows, columns) = (a.rows(), a.columns());
    MatMut::from_row_major_slice_mut(a.as_mut_slice(), rows, columns)
}

/// A copy, row by row.
pub(crate) fn copied(a: MatRef<'_, f64>) -> Matrix {
    let mut copy = Matrix::zeros(a.nrows(), a.ncols());
    view_mut(&mut copy).copy_from(a);
    copy
}

/// Makes the factorisations of `faer` run on one thread: the bits of QR, singular values and eigenvalues depend on the
/// number of threads.
pub(crate) fn on_one_thread() {
    faer::set_global_parallelism(Par::Seq);
}

//! Dense matrix as plain data, and operations that need no factorisation.

mod product;
pub mod vector;

use serde::{Deserialize, Serialize};

pub use product::{multiply_vector, transposed_multiply_vector};

/// A dense matrix of `f64`, stored row by row.
///
/// Stages pass rows to each other: one run, one draw, one replicate. A row is a slice.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Matrix {
    rows: usize,
    columns: usize,
    data: Vec<f64>,
}

/// A matrix as it stands in a file, which may be damaged.
#[derive(Deserialize)]
struct Stored {
    rows: usize,
    columns: usize,
    data: Vec<f64>,
}

impl TryFrom<Stored> for Matrix {
    type Error = String;

    fn try_from(Stored { rows, columns, data }: Stored) -> Result<Self, String> {
        if rows.checked_mul(columns) == Some(data.len()) {
            return Ok(Self { rows, columns, data });
        }
        let count = data.len();
        Err(format!("a matrix of {rows} rows and {columns} columns has {count} numbers"))
    }
}

impl Matrix {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, data: vec![0.0; rows * columns] }
    }

    /// A matrix with entry `(i, j)` equal to `entry(i, j)`.
    pub fn from_fn(
        rows: usize,
        columns: usize,
        mut entry: impl FnMut(usize, usize) -> f64,
    ) -> Self {
        let mut data = Vec::with_capacity(rows * columns);
        for i in 0..rows {
            for j in 0..columns {
                data.push(entry(i, j));
            }
        }
        Self { rows, columns, data }
    }

    /// A matrix from its entries, row by row.
    ///
    /// # Panics
    /// If `data` does not hold `rows * columns` numbers.
    pub fn from_vec(rows: usize, columns: usize, data: Vec<f64>) -> Self {
        assert_eq!(data.len(), rows * columns, "a matrix needs rows x columns entries");
        Self { rows, columns, data }
    }

    /// A matrix from rows of equal length; without rows it is `0 x columns`.
    ///
    /// # Panics
    /// If the length of a row is not `columns`.
    pub fn from_rows<R: AsRef<[f64]>>(columns: usize, rows: impl IntoIterator<Item = R>) -> Self {
        let mut data = Vec::new();
        let mut count = 0;
        for row in rows {
            assert_eq!(row.as_ref().len(), columns, "all rows of a matrix have one length");
            data.extend_from_slice(row.as_ref());
            count += 1;
        }
        Self { rows: count, columns, data }
    }

    /// Number of rows.
    #[inline]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    #[inline]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Row `i`.
    #[inline]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.data[i * self.columns..(i + 1) * self.columns]
    }

    /// Row `i`, mutable.
    #[inline]
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.data[i * self.columns..(i + 1) * self.columns]
    }

    /// The rows in order.
    pub fn iter_rows(&self) -> impl ExactSizeIterator<Item = &[f64]> + Clone {
        (0..self.rows).map(|i| self.row(i))
    }

    /// Copy of column `j`.
    pub fn column(&self, j: usize) -> Vec<f64> {
        (0..self.rows).map(|i| self[(i, j)]).collect()
    }

    /// All entries, row by row.
    #[inline]
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }

    /// All entries, row by row, mutable.
    #[inline]
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// All entries, row by row, without copying.
    pub fn into_vec(self) -> Vec<f64> {
        self.data
    }

    /// The transpose.
    pub fn transposed(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |i, j| self[(j, i)])
    }

    /// The rows with these indices, in the given order.
    pub fn select_rows(&self, indices: &[usize]) -> Self {
        Self::from_rows(self.columns, indices.iter().map(|&i| self.row(i)))
    }

    /// The columns with these indices, in the given order.
    pub fn select_columns(&self, indices: &[usize]) -> Self {
        Self::from_fn(self.rows, indices.len(), |i, j| self[(i, indices[j])])
    }

    /// The entries in some rows and columns, in the given order.
    pub fn select(&self, rows: &[usize], columns: &[usize]) -> Self {
        Self::from_fn(rows.len(), columns.len(), |i, j| self[(rows[i], columns[j])])
    }

    /// Allocates memory for further rows at once.
    pub fn reserve_rows(&mut self, count: usize) {
        self.data.reserve_exact(count * self.columns);
    }

    /// Removes all rows and sets the number of columns; the allocated memory is kept.
    pub fn clear(&mut self, columns: usize) {
        self.data.clear();
        (self.rows, self.columns) = (0, columns);
    }

    /// Removes all but the first `count` rows.
    pub fn truncate_rows(&mut self, count: usize) {
        self.rows = self.rows.min(count);
        self.data.truncate(self.rows * self.columns);
    }

    /// Appends a row from its entries.
    ///
    /// # Panics
    /// If the number of entries differs from the number of columns.
    pub fn extend_row(&mut self, row: impl IntoIterator<Item = f64>) {
        self.data.extend(row);
        self.rows += 1;
        assert_eq!(self.data.len(), self.rows * self.columns, "all rows have one length");
    }

    /// Appends a row.
    ///
    /// # Panics
    /// If the length of the row differs from the number of columns.
    pub fn push_row(&mut self, row: &[f64]) {
        assert_eq!(row.len(), self.columns, "all rows of a matrix have one length");
        self.data.extend_from_slice(row);
        self.rows += 1;
    }
}

impl std::ops::Index<(usize, usize)> for Matrix {
    type Output = f64;
    #[inline]
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.data[i * self.columns + j]
    }
}

impl std::ops::IndexMut<(usize, usize)> for Matrix {
    #[inline]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.data[i * self.columns + j]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stored_matrix_has_as_many_numbers_as_it_says() {
        let read = |text: &str| serde_json::from_str::<Matrix>(text);
        let matrix = Matrix::from_fn(2, 3, |i, j| (i * 3 + j) as f64 / 7.0);
        assert_eq!(read(&serde_json::to_string(&matrix).unwrap()).unwrap(), matrix);
        for (rows, columns) in [(2, 2), (0, 3), (usize::MAX, 3), (3, usize::MAX / 2)] {
            let text =
                format!(r#"{{"rows": {rows}, "columns": {columns}, "data": [1.0, 2.0, 3.0]}}"#);
            let error = read(&text).unwrap_err().to_string();
            assert!(error.contains(&format!("{rows} rows and {columns} columns has 3")), "{error}");
        }
    }
}

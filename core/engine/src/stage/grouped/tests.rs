#![allow(clippy::unwrap_used)]
use super::*;

/// A curve of two values: the sum of both inputs, and the square of the first.
struct Model(FitError);

impl Forward for Model {
    fn dimension(&self) -> usize {
        2
    }
    fn outputs(&self) -> usize {
        2
    }
    fn mean(&self, points: &Matrix) -> Matrix {
        let value = |i: usize, k: usize| match k {
            0 => points[(i, 0)] + points[(i, 1)],
            _ => points[(i, 0)].powi(2),
        };
        Matrix::from_fn(points.rows(), 2, value)
    }
    fn jacobian(&self, point: &[f64]) -> Matrix {
        Matrix::from_vec(2, 2, vec![1.0, 1.0, 2.0 * point[0], 0.0])
    }
    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }
}

impl Linear for Model {
    fn coefficients(&self) -> &Matrix {
        static COEFFICIENTS: std::sync::OnceLock<Matrix> = std::sync::OnceLock::new();
        COEFFICIENTS.get_or_init(|| Matrix::from_vec(3, 2, vec![1.0, 0.0, 1.0, 0.0, 0.0, 1.0]))
    }
    fn basis(&self, points: &Matrix) -> Matrix {
        let value = |i: usize, k: usize| match k {
            0 | 1 => points[(i, k)],
            _ => points[(i, 0)].powi(2),
        };
        Matrix::from_fn(points.rows(), 3, value)
    }
    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        Matrix::from_vec(3, 2, vec![1.0, 0.0, 0.0, 1.0, 2.0 * point[0], 0.0])
    }
}

impl Emulator for Model {
    fn fit_error(&self) -> &FitError {
        &self.0
    }
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
    fn save(&self) -> Result<Vec<u8>, Stop> {
        Ok(Vec::new())
    }
}

/// Two groups that share the second input, as in a study with the parameters `a[x]`, `a[y]` and `b`; the responses of the
/// second group come first.
fn grouped() -> Grouped {
    let part = |own: usize, begin: usize| Part {
        parameters: vec![own, 2],
        outputs: vec![(0..2, begin..begin + 2)],
    };
    let spread = Spread { parts: vec![part(0, 2), part(1, 0)], dimension: 3, outputs: 4 };
    let model = Model(FitError::default());
    let coefficients = Some(spread.coefficients(model.coefficients()));
    Grouped { emulator: Box::new(model), spread, coefficients, fit_error: FitError::default() }
}

#[test]
fn every_group_has_the_response_to_its_own_values() {
    let grouped = grouped();
    let point = [2.0, 3.0, 10.0];
    let mean = grouped.mean(&Matrix::from_vec(1, 3, point.to_vec()));
    assert_eq!(mean.row(0), [13.0, 9.0, 12.0, 4.0]);
    let jacobian = grouped.jacobian(&point);
    assert_eq!(jacobian.row(0), [0.0, 1.0, 1.0]);
    assert_eq!(jacobian.row(1), [0.0, 6.0, 0.0]);
    assert_eq!(jacobian.row(2), [1.0, 0.0, 1.0]);
    assert_eq!(jacobian.row(3), [4.0, 0.0, 0.0]);
}

#[test]
fn the_linear_form_is_the_same_map() {
    let grouped = grouped();
    let point = [2.0, 3.0, 10.0];
    let row = Matrix::from_vec(1, 3, point.to_vec());
    let linear = grouped.linear().unwrap();
    let product = lacuna_linalg::multiply(&linear.basis(&row), linear.coefficients());
    assert_eq!(product.row(0), grouped.mean(&row).row(0));
    let slopes =
        lacuna_linalg::transposed_multiply(linear.coefficients(), &linear.basis_gradient(&point));
    assert_eq!(slopes.as_slice(), grouped.jacobian(&point).as_slice());
}

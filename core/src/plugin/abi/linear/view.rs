//! A linear forward map of the other side.

use std::sync::{Arc, OnceLock};

use crate::linalg::Matrix;
use crate::plugin::abi::table::{
    Answer, Linear, LinearFunctions, Numbers, Squares, SquaresFunctions, copied, read, status,
    whole,
};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::fault::Fault;
use crate::plugin::forward::{self, SumOfSquares};

/// A linear forward map that the other side evaluates. Without an answer it has a fault and says NaN.
pub struct LinearView {
    linear: Linear,
    functions: LinearFunctions,
    coefficients: OnceLock<Matrix>,
    fault: Arc<Fault>,
}

// SAFETY: the functions of a table may be called from any thread, and what they point to outlives the view.
unsafe impl Send for LinearView {}
// SAFETY: as for `Send`.
unsafe impl Sync for LinearView {}

impl LinearView {
    /// A view of a map that is there for as long as the view is used. That there are coefficients is checked here,
    /// and nothing else about them.
    ///
    /// # Safety
    /// The struct and its functions are those of a map that outlives the view.
    pub unsafe fn new(linear: Linear, fault: Arc<Fault>) -> Result<Self, Refusal> {
        // SAFETY: the table belongs to the map.
        let functions = unsafe { copied(linear.functions) }
            .map_err(|refusal| Refusal::stop(format!("a linear map {}", refusal.message)))?;
        // SAFETY: the coefficients are there as long as the map.
        unsafe { linear.coefficients.slice()? };
        Ok(Self { linear, functions, coefficients: OnceLock::new(), fault })
    }

    fn terms(&self) -> usize {
        self.linear.coefficients.rows
    }

    /// What was answered; without that the map has a fault.
    fn sound<T>(&self, answered: Result<T, Refusal>) -> Option<T> {
        let complain = |refusal: Refusal| {
            self.fault.report(format_args!("its linear map: {}", refusal.message));
        };
        answered.map_err(complain).ok()
    }

    /// A matrix that the map fills. Far away from where it was fitted a map may well give NaN.
    fn filled(
        &self,
        what: &'static str,
        rows: usize,
        columns: usize,
        fill: impl FnOnce(*mut f64, *const Answer) -> i32,
    ) -> Matrix {
        let mut matrix = Matrix::from_fn(rows, columns, |_, _| f64::NAN);
        let to = matrix.as_mut_slice().as_mut_ptr();
        self.sound(Reply::of(what, |answer| fill(to, answer)));
        matrix
    }
}

impl forward::Linear for LinearView {
    fn coefficients(&self) -> &Matrix {
        self.coefficients.get_or_init(|| {
            // SAFETY: the coefficients are there as long as the map.
            let own = unsafe { self.linear.coefficients.matrix() };
            self.sound(own).unwrap_or_default()
        })
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let basis = self.functions.basis;
        self.filled("basis", points.rows(), self.terms(), |to, answer| {
            // SAFETY: the buffer has a row of basis functions a point.
            basis.map_or(status::ABSENT, |f| unsafe {
                f(self.linear.map, Numbers::of(points), to, answer)
            })
        })
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let gradient = self.functions.basis_gradient;
        self.filled("basis_gradient", self.terms(), point.len(), |to, answer| {
            // SAFETY: the buffer has `terms x parameters` numbers.
            gradient.map_or(status::ABSENT, |f| unsafe {
                f(self.linear.map, Numbers::row(point), to, answer)
            })
        })
    }

    fn sum_of_squares(&self, factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        let ask = self.functions.sum_of_squares?;
        let mut squares = Squares {
            size: 0,
            squares: std::ptr::null_mut(),
            functions: std::ptr::null(),
            error: f64::NAN,
        };
        // SAFETY: the place for the form is ours.
        let reply = Reply::of("sum_of_squares", |a| unsafe {
            ask(self.linear.map, Numbers::of(factor), &raw mut squares, a)
        });
        let form = match reply {
            Ok(_) => SquaresView::of(squares, self.fault.clone()).map(Some),
            Err(refusal) if refusal.status == status::ABSENT => Ok(None),
            Err(refusal) => Err(refusal),
        };
        let form = self.sound(form)??;
        Some(Box::new(form))
    }
}

/// A sum of squares that the other side evaluates.
struct SquaresView {
    squares: Squares,
    functions: SquaresFunctions,
    fault: Arc<Fault>,
}

// SAFETY: as for `LinearView`; the form is the view's own until it is dropped.
unsafe impl Send for SquaresView {}
// SAFETY: as for `Send`.
unsafe impl Sync for SquaresView {}

impl SquaresView {
    /// A form that was handed over; one that cannot be used is ended, if it can be.
    fn of(squares: Squares, fault: Arc<Fault>) -> Result<Self, Refusal> {
        let wrong = |what: &str| Refusal::stop(format!("its sum of squares {what}"));
        // SAFETY: whoever made the form gave its functions, which are constants.
        let functions = unsafe { read(squares.functions) }.map_err(|e| wrong(&e.message))?;
        let form = Self { squares, functions, fault };
        if squares.squares.is_null() {
            return Err(wrong("is not there"));
        }
        whole(&form.functions).map_err(|e| wrong(&e.message))?;
        if !(squares.error >= 0.0 && squares.error.is_finite()) {
            return Err(wrong(&format!("has the error {}", squares.error)));
        }
        Ok(form)
    }

    fn ask(&self, points: &Matrix, columns: usize, gradient: bool) -> Matrix {
        let mut values = Matrix::from_fn(points.rows(), columns, |_, _| f64::NAN);
        let to = values.as_mut_slice().as_mut_ptr();
        let (what, function) = if gradient {
            ("gradient", self.functions.gradient)
        } else {
            ("values", self.functions.values)
        };
        let call = |a| {
            // SAFETY: the form is alive, and the buffer has `points x columns` numbers.
            function.map_or(status::ABSENT, |f| unsafe {
                f(self.squares.squares, Numbers::of(points), to, a)
            })
        };
        if let Err(refusal) = Reply::of(what, call) {
            self.fault.report(format_args!("its sum of squares: {}", refusal.message));
        }
        values
    }
}

impl SumOfSquares for SquaresView {
    fn values(&self, points: &Matrix) -> Vec<f64> {
        self.ask(points, 1, false).into_vec()
    }

    fn gradient(&self, point: &[f64]) -> Vec<f64> {
        let row = Matrix::from_vec(1, point.len(), point.to_vec());
        self.ask(&row, point.len(), true).into_vec()
    }

    fn covers(&self, point: &[f64]) -> bool {
        self.covers_all(&Matrix::from_vec(1, point.len(), point.to_vec()))
    }

    fn covers_all(&self, points: &Matrix) -> bool {
        let covers = self.functions.covers;
        // SAFETY: the form is alive.
        covers.is_some_and(|f| unsafe { f(self.squares.squares, Numbers::of(points)) == 1 })
    }

    fn error(&self) -> f64 {
        self.squares.error
    }
}

impl Drop for SquaresView {
    fn drop(&mut self) {
        if let Some(destroy) = self.functions.destroy
            && !self.squares.squares.is_null()
        {
            // SAFETY: the form is the view's own, and this is its last use.
            unsafe { destroy(self.squares.squares) }
        }
    }
}

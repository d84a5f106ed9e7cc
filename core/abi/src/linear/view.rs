//! A linear forward map of the other side.

use std::sync::{Arc, OnceLock};

use lacuna::matrix::Matrix;
use lacuna::plugin::forward::{self, SumOfSquares};
use lacuna::run::fault::Fault;

use crate::object::Asked;
use crate::table::{Linear, LinearFunctions, Numbers, Squares, SquaresFunctions, copied};
use crate::{Object, Refusal};

/// A linear forward map that the other side evaluates. Without an answer it has a fault and says NaN.
pub struct LinearView {
    map: Object<LinearFunctions>,
    given: Numbers,
    coefficients: OnceLock<Matrix>,
}

// SAFETY: the coefficients that are pointed to outlive the view, and nobody changes them.
unsafe impl Send for LinearView {}
// SAFETY: as for `Send`.
unsafe impl Sync for LinearView {}

/// The answer; without one the object has a fault.
fn sound<F, T>(what: &str, object: &Object<F>, answered: Result<T, Refusal>) -> Option<T> {
    let complain =
        |refusal: Refusal| object.fault().report(format_args!("{what}: {}", refusal.message));
    answered.map_err(complain).ok()
}

/// A matrix that an object fills. Far away from where it was fitted a map may well give NaN.
fn filled<F>(
    what: &str,
    object: &Object<F>,
    (rows, columns): (usize, usize),
    fill: impl FnOnce(*mut f64) -> Asked,
) -> Matrix {
    let mut matrix = Matrix::from_fn(rows, columns, |_, _| f64::NAN);
    let asked = fill(matrix.as_mut_slice().as_mut_ptr());
    sound(what, object, asked.demand_plain());
    matrix
}

const MAP: &str = "its linear map";
const FORM: &str = "its sum of squares";

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
        let map = Object::new(linear.map, functions, None, fault);
        Ok(Self { map, given: linear.coefficients, coefficients: OnceLock::new() })
    }

    fn terms(&self) -> usize {
        self.given.rows
    }

    fn form(&self, factor: &Matrix) -> Result<Option<SquaresView>, Refusal> {
        let mut made = Squares {
            size: 0,
            squares: std::ptr::null_mut(),
            functions: std::ptr::null(),
            error: f64::NAN,
        };
        // SAFETY: the place for the form is ours.
        let asked = unsafe { self.map.sum_of_squares(factor, &raw mut made) };
        if asked.if_any()?.is_none() {
            return Ok(None);
        }
        let (what, fault) = ("sum of squares", self.map.fault().clone());
        // SAFETY: whoever made the form gave it over with its functions, which are constants.
        let form = unsafe {
            Object::made(what, made.squares, made.functions, |table| table.destroy, fault)?
        };
        let error = made.error;
        if !(error >= 0.0 && error.is_finite()) {
            return Err(Refusal::stop(format!("its sum of squares has the error {error}")));
        }
        Ok(Some(SquaresView { form, error }))
    }
}

impl forward::Linear for LinearView {
    fn coefficients(&self) -> &Matrix {
        self.coefficients.get_or_init(|| {
            // SAFETY: the coefficients are there as long as the map.
            let own = unsafe { self.given.matrix() };
            sound(MAP, &self.map, own).unwrap_or_default()
        })
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        // SAFETY: the buffer has a row of basis functions a point.
        let call = |to| unsafe { self.map.basis(points, to) };
        filled(MAP, &self.map, (points.rows(), self.terms()), call)
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        // SAFETY: the buffer has `terms x parameters` numbers.
        let call = |to| unsafe { self.map.basis_gradient(point, to) };
        filled(MAP, &self.map, (self.terms(), point.len()), call)
    }

    fn sum_of_squares(&self, factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        let form = sound(MAP, &self.map, self.form(factor))??;
        Some(Box::new(form))
    }
}

/// A sum of squares that the other side evaluates.
struct SquaresView {
    form: Object<SquaresFunctions>,
    error: f64,
}

impl SumOfSquares for SquaresView {
    fn values(&self, points: &Matrix) -> Vec<f64> {
        // SAFETY: the buffer has a number a point.
        let call = |to| unsafe { self.form.values(points, to) };
        filled(FORM, &self.form, (points.rows(), 1), call).into_vec()
    }

    fn gradient(&self, point: &[f64]) -> Vec<f64> {
        // SAFETY: the buffer has a number a parameter.
        let call = |to| unsafe { self.form.gradient(point, to) };
        filled(FORM, &self.form, (1, point.len()), call).into_vec()
    }

    fn covers(&self, point: &[f64]) -> bool {
        // SAFETY: nothing is written.
        unsafe { self.form.covers(point) == Some(1) }
    }

    fn covers_all(&self, points: &Matrix) -> bool {
        // SAFETY: nothing is written.
        unsafe { self.form.covers(points) == Some(1) }
    }

    fn error(&self) -> f64 {
        self.error
    }
}

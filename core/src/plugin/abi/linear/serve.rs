//! A linear forward map for the other side to ask.

use std::ffi::c_void;

use crate::linalg::Matrix;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{begin, end, fill, guard, guard_number, object};
use crate::plugin::abi::table::{
    Answer, Linear, LinearFunctions, Numbers, Squares, SquaresFunctions,
};
use crate::plugin::forward::{self, SumOfSquares};

/// A linear forward map as it is handed over. What is handed over points into this value.
pub struct ServedLinear<'a>(&'a dyn forward::Linear);

impl<'a> ServedLinear<'a> {
    /// Serves a map.
    pub fn new(linear: &'a dyn forward::Linear) -> Self {
        Self(linear)
    }

    /// What the other side is given: good for as long as this value stays where it is.
    pub fn table(&self) -> Linear {
        Linear {
            size: size_of::<Linear>(),
            map: (&raw const *self).cast_mut().cast(),
            functions: &raw const LINEAR,
            coefficients: Numbers::of(self.0.coefficients()),
        }
    }
}

static LINEAR: LinearFunctions = LinearFunctions {
    size: size_of::<LinearFunctions>(),
    basis: Some(basis),
    basis_gradient: Some(basis_gradient),
    sum_of_squares: Some(sum_of_squares),
};

static SQUARES: SquaresFunctions = SquaresFunctions {
    size: size_of::<SquaresFunctions>(),
    destroy: Some(end::<Box<dyn SumOfSquares>>),
    values: Some(squares_values),
    gradient: Some(squares_gradient),
    covers: Some(squares_covers),
};

/// The map behind the first argument.
///
/// # Safety
/// It is one of [`ServedLinear::table`], whose value is still there.
unsafe fn map<'a>(map: *mut c_void) -> &'a dyn forward::Linear {
    // SAFETY: as the caller promises.
    unsafe { object::<ServedLinear<'a>>(map) }.0
}

unsafe extern "C" fn basis(
    this: *mut c_void,
    points: Numbers,
    basis: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the map of the table, and numbers that are there for the time of the call.
        let (map, points) = unsafe { (map(this), points.matrix()?) };
        let count = points.rows() * map.coefficients().rows();
        // SAFETY: the buffer holds one row of basis functions a point.
        unsafe { fill(basis, count, map.basis(&points).as_slice()) }
    })
}

unsafe extern "C" fn basis_gradient(
    this: *mut c_void,
    point: Numbers,
    gradient: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `basis`.
        let (map, point) = unsafe { (map(this), point.slice()?) };
        let count = point.len() * map.coefficients().rows();
        // SAFETY: the buffer holds `terms x parameters` numbers.
        unsafe { fill(gradient, count, map.basis_gradient(point).as_slice()) }
    })
}

unsafe extern "C" fn sum_of_squares(
    this: *mut c_void,
    factor: Numbers,
    out: *mut Squares,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `basis`.
        let (map, factor) = unsafe { (map(this), factor.matrix()?) };
        let squares = map.sum_of_squares(&factor).ok_or_else(Refusal::absent)?;
        let error = squares.error();
        let (size, squares) = (size_of::<Squares>(), begin(squares));
        // SAFETY: the caller gives a place for one form.
        unsafe { *out = Squares { size, squares, functions: &raw const SQUARES, error } };
        Ok(())
    })
}

/// The form behind the first argument.
///
/// # Safety
/// It was made by [`sum_of_squares`] and not ended.
unsafe fn form<'a>(squares: *mut c_void) -> &'a dyn SumOfSquares {
    // SAFETY: as the caller promises.
    &**unsafe { object::<Box<dyn SumOfSquares>>(squares) }
}

unsafe extern "C" fn squares_values(
    squares: *mut c_void,
    points: Numbers,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: a form of ours, and numbers that are there for the time of the call.
        let (form, points) = unsafe { (form(squares), points.matrix()?) };
        // SAFETY: the buffer holds one number a point.
        unsafe { fill(values, points.rows(), &form.values(&points)) }
    })
}

unsafe extern "C" fn squares_gradient(
    squares: *mut c_void,
    points: Numbers,
    gradient: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `squares_values`.
        let (form, points) = unsafe { (form(squares), points.matrix()?) };
        let all = Matrix::from_rows(points.columns(), points.iter_rows().map(|p| form.gradient(p)));
        // SAFETY: the buffer holds one row of derivatives a point.
        unsafe { fill(gradient, points.as_slice().len(), all.as_slice()) }
    })
}

unsafe extern "C" fn squares_covers(squares: *mut c_void, points: Numbers) -> i32 {
    guard_number(0, || {
        // SAFETY: as in `squares_values`.
        let (form, points) = unsafe { (form(squares), points.matrix()) };
        points.map_or(0, |points| i32::from(form.covers_all(&points)))
    })
}

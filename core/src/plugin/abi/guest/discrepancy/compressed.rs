//! The compressed likelihoods of a library's discrepancies.

use std::ffi::c_void;

use super::likelihood::density;
use super::{Guest, row_by_row};
use crate::plugin::abi::guard::{end, fill, guard, object};
use crate::plugin::abi::linear::LinearView;
use crate::plugin::abi::table::{Answer, CompressedFunctions, Linear, Numbers};
use crate::plugin::discrepancy::Compressed;

type Own = Guest<dyn Compressed>;

pub(super) static FUNCTIONS: CompressedFunctions = CompressedFunctions {
    size: size_of::<CompressedFunctions>(),
    destroy: Some(end::<Own>),
    log_likelihood: Some(log_likelihood),
    gradient: Some(gradient),
    log_likelihood_at: Some(log_likelihood_at),
    gradient_at: Some(gradient_at),
};

unsafe extern "C" fn log_likelihood(
    this: *mut c_void,
    basis: Numbers,
    hyper: Numbers,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: a likelihood of ours, and numbers that are there for the time of the call.
        let (this, basis, hyper) =
            unsafe { (object::<Own>(this), basis.matrix()?, hyper.matrix()?) };
        let all: Vec<f64> =
            this.own.log_likelihood(&basis, &hyper).into_iter().map(density).collect();
        this.sound()?;
        // SAFETY: the buffer holds one number a point.
        unsafe { fill(values, basis.rows(), &all) }
    })
}

unsafe extern "C" fn log_likelihood_at(
    this: *mut c_void,
    linear: *const Linear,
    points: Numbers,
    hyper: Numbers,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `log_likelihood`; the map is there for the time of the call.
        let (this, points, hyper) =
            unsafe { (object::<Own>(this), points.matrix()?, hyper.matrix()?) };
        // SAFETY: as above.
        let view = unsafe { LinearView::new(*linear, this.fault.clone())? };
        let all = this.own.log_likelihood_at(&view, &points, &hyper);
        let all: Vec<f64> = all.into_iter().map(density).collect();
        this.sound()?;
        // SAFETY: the buffer holds one number a point.
        unsafe { fill(values, points.rows(), &all) }
    })
}

unsafe extern "C" fn gradient(
    this: *mut c_void,
    basis: Numbers,
    hyper: Numbers,
    by_basis: *mut f64,
    by_hyper: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `log_likelihood`.
        let (this, basis, hyper) =
            unsafe { (object::<Own>(this), basis.matrix()?, hyper.matrix()?) };
        let (a, b) = row_by_row(&basis, &hyper, |basis, hyper| this.own.gradient(basis, hyper));
        this.sound()?;
        // SAFETY: the buffers hold one row a point.
        unsafe {
            fill(by_basis, basis.as_slice().len(), &a)?;
            fill(by_hyper, hyper.as_slice().len(), &b)
        }
    })
}

unsafe extern "C" fn gradient_at(
    this: *mut c_void,
    linear: *const Linear,
    points: Numbers,
    hyper: Numbers,
    by_points: *mut f64,
    by_hyper: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `log_likelihood_at`.
        let (this, points, hyper) =
            unsafe { (object::<Own>(this), points.matrix()?, hyper.matrix()?) };
        // SAFETY: as above.
        let view = unsafe { LinearView::new(*linear, this.fault.clone())? };
        let one = |point: &[f64], hyper: &[f64]| this.own.gradient_at(&view, point, hyper);
        let (a, b) = row_by_row(&points, &hyper, one);
        this.sound()?;
        // SAFETY: the buffers hold one row a point.
        unsafe {
            fill(by_points, points.as_slice().len(), &a)?;
            fill(by_hyper, hyper.as_slice().len(), &b)
        }
    })
}

//! A log density for samplers of a library to ask.

use std::ffi::c_void;

use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::Target;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{fill, guard, object};
use crate::plugin::abi::table::{self, Answer, Key, Numbers, TargetFunctions};

/// A log density as it is handed over. What is handed over points into this value.
pub(super) struct ServedTarget<'a>(pub &'a dyn Target);

static FUNCTIONS: TargetFunctions = TargetFunctions {
    size: size_of::<TargetFunctions>(),
    log_density: Some(log_density),
    log_prior: Some(log_prior),
    gradient: Some(gradient),
    bounds: Some(bounds),
    prior_draws: Some(prior_draws),
    failure: Some(failure),
};

impl ServedTarget<'_> {
    /// What the other side is given: good for as long as this value stays where it is.
    pub fn table(&self) -> table::Target {
        table::Target {
            size: size_of::<table::Target>(),
            target: (&raw const *self).cast_mut().cast(),
            functions: &raw const FUNCTIONS,
            dimension: self.0.dimension(),
        }
    }
}

/// The density behind the first argument.
///
/// # Safety
/// It is that of [`ServedTarget::table`], whose value is still there.
unsafe fn target<'a>(target: *mut c_void) -> &'a dyn Target {
    // SAFETY: as the caller promises.
    unsafe { object::<ServedTarget<'a>>(target) }.0
}

/// Points of the density's dimension.
///
/// # Safety
/// The numbers are there.
unsafe fn points(target: &dyn Target, points: Numbers) -> Result<Matrix, Refusal> {
    let dimension = target.dimension();
    if points.columns != dimension {
        let found = points.columns;
        return Err(Refusal::stop(format!(
            "was asked at points of {found} coordinates in place of {dimension}"
        )));
    }
    // SAFETY: as the caller promises.
    unsafe { points.matrix() }
}

/// Fills a buffer with something at each point.
///
/// # Safety
/// It is the density of the table; points and buffer, which holds one number a point, are there.
unsafe fn at_points(
    this: *mut c_void,
    at: Numbers,
    values: *mut f64,
    answer: *const Answer,
    ask: fn(&dyn Target, &Matrix) -> Vec<f64>,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as the caller promises.
        let (target, points) = unsafe { (target(this), points(target(this), at)?) };
        // SAFETY: as the caller promises.
        unsafe { fill(values, points.rows(), &ask(target, &points)) }
    })
}

unsafe extern "C" fn log_density(
    this: *mut c_void,
    at: Numbers,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { at_points(this, at, values, answer, |target, points| target.log_density(points)) }
}

unsafe extern "C" fn log_prior(
    this: *mut c_void,
    at: Numbers,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { at_points(this, at, values, answer, |target, points| target.log_prior(points)) }
}

unsafe extern "C" fn gradient(
    this: *mut c_void,
    at: Numbers,
    value: *mut f64,
    slopes: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the density of the table, and numbers that are there for the time of the call.
        let (target, points) = unsafe { (target(this), points(target(this), at)?) };
        if points.rows() != 1 {
            let found = points.rows();
            return Err(Refusal::stop(format!("was asked for the gradient at {found} points")));
        }
        let (density, gradient) = target.gradient(points.as_slice());
        // SAFETY: the buffers hold one number, and one a coordinate.
        unsafe {
            fill(value, 1, &[density])?;
            fill(slopes, target.dimension(), &gradient)
        }
    })
}

unsafe extern "C" fn bounds(
    this: *mut c_void,
    low: *mut f64,
    high: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `gradient`.
        let target = unsafe { target(this) };
        let (from, to): (Vec<f64>, Vec<f64>) = target.bounds().into_iter().unzip();
        // SAFETY: the buffers hold one number a coordinate.
        unsafe {
            fill(low, target.dimension(), &from)?;
            fill(high, target.dimension(), &to)
        }
    })
}

unsafe extern "C" fn prior_draws(
    this: *mut c_void,
    count: usize,
    key: Key,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `gradient`.
        let target = unsafe { target(this) };
        let size = count.checked_mul(target.dimension());
        let size = size.filter(|size| *size <= isize::MAX as usize / size_of::<f64>());
        let too_many = || Refusal::stop(format!("was asked for {count} draws"));
        let size = size.ok_or_else(too_many)?;
        let draws = target.prior_draws(count, &Stream::from_key(key.words));
        // SAFETY: the buffer holds `count x dimension` numbers.
        unsafe { fill(to, size, draws.as_slice()) }
    })
}

unsafe extern "C" fn failure(this: *mut c_void, answer: *const Answer) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `gradient`.
        out.text(&unsafe { target(this) }.failure().ok_or_else(Refusal::absent)?);
        Ok(())
    })
}

//! The inside of a function that the other side calls: nothing unwinds out of it.

use std::any::Any;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

use lacuna::matrix::Matrix;
use serde::Serialize;

use crate::basic::{Answer, Numbers, Text};
use crate::{Refusal, status};

/// The place to which the answer of a call goes.
pub struct Out(*const Answer);

impl Out {
    /// Appends to the text.
    pub fn text(&self, text: &str) {
        self.bytes(text.as_bytes());
    }

    /// Appends bytes to the text.
    pub fn bytes(&self, bytes: &[u8]) {
        // SAFETY: an answer is null or lives as long as the call that it was given to.
        if let Some(answer) = unsafe { self.0.as_ref() }
            && let Some(text) = answer.text
        {
            // SAFETY: the function belongs to this context and copies what it is given.
            unsafe { text(answer.context, Text::of_bytes(bytes)) }
        }
    }

    /// Adds a matrix.
    pub fn numbers(&self, matrix: &Matrix) {
        self.view(Numbers::of(matrix));
    }

    /// Adds a matrix of one row.
    pub fn row(&self, row: &[f64]) {
        self.view(Numbers::row(row));
    }

    fn view(&self, view: Numbers) {
        // SAFETY: as in `bytes`.
        if let Some(answer) = unsafe { self.0.as_ref() }
            && let Some(numbers) = answer.numbers
        {
            // SAFETY: as in `bytes`.
            unsafe { numbers(answer.context, view) }
        }
    }

    /// Writes a value as JSON.
    pub fn json(&self, value: &impl Serialize) -> Result<(), Refusal> {
        self.text(&serde_json::to_string(value)?);
        Ok(())
    }
}

/// The end of a function with an answer.
pub type Done = Result<(), Refusal>;

/// Runs the body of a function that the other side calls, and turns its end into a status.
pub fn guard(answer: *const Answer, body: impl FnOnce(&Out) -> Done) -> i32 {
    let out = Out(answer);
    match catch_unwind(AssertUnwindSafe(|| body(&out))) {
        Ok(Ok(())) => status::OK,
        Ok(Err(refusal)) => {
            out.text(&refusal.message);
            refusal.status
        }
        Err(payload) => {
            out.text(message(&*payload));
            left(payload);
            status::PANIC
        }
    }
}

/// Runs a body that can only say a number; a panic says `otherwise`.
pub fn guard_number<T>(otherwise: T, body: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|payload| {
        left(payload);
        otherwise
    })
}

/// Lets what a panic carried be: its end might panic too, outside of any guard.
fn left(payload: Box<dyn Any + Send>) {
    std::mem::forget(payload);
}

/// The message of a panic.
fn message(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no reason given")
}

/// Copies numbers into a buffer of the caller's.
///
/// # Safety
/// `to` leads to `count` numbers that nobody else uses.
pub unsafe fn fill(to: *mut f64, count: usize, from: &[f64]) -> Result<(), Refusal> {
    if from.len() != count {
        return Err(Refusal::stop(format!("gives {} numbers where {count} belong", from.len())));
    }
    if count > 0 {
        // SAFETY: both hold `count` numbers, and the buffer is the caller's alone.
        unsafe { std::ptr::copy_nonoverlapping(from.as_ptr(), to, count) }
    }
    Ok(())
}

/// Makes an object for the other side, which ends it with [`end`].
pub fn begin<T>(object: T) -> *mut c_void {
    Box::into_raw(Box::new(object)).cast()
}

/// The object behind a pointer.
///
/// # Safety
/// The pointer came from [`begin`] with the same type and was not ended.
pub unsafe fn object<'a, T>(pointer: *mut c_void) -> &'a T {
    // SAFETY: as the caller promises.
    unsafe { &*pointer.cast::<T>() }
}

/// Ends an object.
///
/// # Safety
/// As for [`object`]; it is used no more.
pub unsafe extern "C" fn end<T>(pointer: *mut c_void) {
    if !pointer.is_null() {
        guard_number((), || {
            // SAFETY: the box of `begin`, for the last time.
            drop(unsafe { Box::from_raw(pointer.cast::<T>()) });
        });
    }
}

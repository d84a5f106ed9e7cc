//! The arguments of a function, as the side that is called gets them.

use std::marker::PhantomData;
use std::ops::Deref;

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;

use crate::Refusal;
use crate::basic::{Key, Numbers, Text};
use crate::guard;

/// An argument of a function of a table.
pub trait Argument: Sized {
    /// The argument as the side that is called gets it, for the time of the call.
    type Given<'a>;

    /// Reads the argument, unless it cannot be one.
    ///
    /// # Safety
    /// Everything that the argument points to is there during `'a`, and nobody else uses what is written to.
    unsafe fn given<'a>(self) -> Result<Self::Given<'a>, Refusal>;
}

impl Argument for Text {
    type Given<'a> = &'a [u8];

    unsafe fn given<'a>(self) -> Result<&'a [u8], Refusal> {
        // SAFETY: as the caller promises.
        Ok(unsafe { self.bytes() })
    }
}

/// A matrix of the caller's; as a slice, its numbers row by row.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    numbers: &'a [f64],
    /// The number of rows.
    pub rows: usize,
    /// The number of columns.
    pub columns: usize,
}

impl Rows<'_> {
    /// A copy.
    pub fn matrix(&self) -> Matrix {
        Matrix::from_vec(self.rows, self.columns, self.numbers.to_vec())
    }
}

impl Deref for Rows<'_> {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        self.numbers
    }
}

impl Argument for Numbers {
    type Given<'a> = Rows<'a>;

    unsafe fn given<'a>(self) -> Result<Rows<'a>, Refusal> {
        // SAFETY: as the caller promises.
        let numbers = unsafe { self.slice()? };
        Ok(Rows { numbers, rows: self.rows, columns: self.columns })
    }
}

impl Argument for Key {
    type Given<'a> = Stream;

    unsafe fn given<'a>(self) -> Result<Self::Given<'a>, Refusal> {
        Ok(Stream::from_key(self.words))
    }
}

impl Argument for usize {
    type Given<'a> = Self;

    unsafe fn given<'a>(self) -> Result<Self::Given<'a>, Refusal> {
        Ok(self)
    }
}

impl Argument for u64 {
    type Given<'a> = Self;

    unsafe fn given<'a>(self) -> Result<Self::Given<'a>, Refusal> {
        Ok(self)
    }
}

/// Something of the caller's to read.
#[derive(Debug, Clone, Copy)]
pub struct Lent<'a, T>(*const T, PhantomData<&'a T>);

impl<'a, T> Lent<'a, T> {
    /// True where there is nothing.
    pub fn is_null(self) -> bool {
        self.0.is_null()
    }

    /// The one thing that is there.
    ///
    /// # Safety
    /// The table says that there is one.
    pub unsafe fn one(self) -> &'a T {
        // SAFETY: the pointer is that of a call that is under way; as the caller promises.
        unsafe { &*self.0 }
    }

    /// As many as the call says; none where there is nothing.
    ///
    /// # Safety
    /// The table says that there are so many.
    pub unsafe fn all(self, count: usize) -> &'a [T] {
        if count == 0 || self.0.is_null() {
            return &[];
        }
        // SAFETY: as in `one`.
        unsafe { std::slice::from_raw_parts(self.0, count) }
    }
}

impl<T: 'static> Argument for *const T {
    type Given<'a> = Lent<'a, T>;

    unsafe fn given<'a>(self) -> Result<Lent<'a, T>, Refusal> {
        Ok(Lent(self, PhantomData))
    }
}

/// A place of the caller's to write to.
#[derive(Debug)]
pub struct Space<'a, T>(*mut T, PhantomData<&'a mut T>);

impl<T> Space<'_, T> {
    /// The first place.
    pub fn pointer(&self) -> *mut T {
        self.0
    }

    /// Writes one thing.
    ///
    /// # Safety
    /// The table says that there is a place for one.
    pub unsafe fn put(&self, thing: T) {
        // SAFETY: the pointer is that of a call that is under way; as the caller promises.
        unsafe { self.0.write(thing) }
    }
}

/// A place for numbers.
pub type Buffer<'a> = Space<'a, f64>;

impl Buffer<'_> {
    /// Copies numbers, of which there must be `count`.
    ///
    /// # Safety
    /// The table says that there are places for `count` numbers.
    pub unsafe fn fill(&self, count: usize, from: &[f64]) -> Result<(), Refusal> {
        // SAFETY: as in `put`.
        unsafe { guard::fill(self.0, count, from) }
    }
}

impl<T: 'static> Argument for *mut T {
    type Given<'a> = Space<'a, T>;

    unsafe fn given<'a>(self) -> Result<Space<'a, T>, Refusal> {
        Ok(Space(self, PhantomData))
    }
}

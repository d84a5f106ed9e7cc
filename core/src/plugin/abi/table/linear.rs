//! A forward map that is linear in basis functions.

use std::ffi::c_void;

use super::{Answer, Numbers};

functions! {
    /// A sum of squares `|R (psi(x), 1)|^2` as a function of the point.
    SquaresFunctions {
        /// Ends it.
        must destroy(squares: *mut c_void);
        /// The sum at each point.
        must values(squares: *mut c_void, points: Numbers, values: *mut f64, answer: *const Answer) -> i32;
        /// The derivatives at each point, `points x parameters`.
        must gradient(squares: *mut c_void, points: Numbers, gradient: *mut f64, answer: *const Answer) -> i32;
        /// 1 where the form holds at all of these points to its error, else 0.
        must covers(squares: *mut c_void, points: Numbers) -> i32;
    }
}

record! {
    /// A sum of squares of linear combinations of basis functions.
    Squares {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        squares: *mut c_void,
        /// What it does.
        functions: *const SquaresFunctions,
        /// The largest difference from the product's own sum of squares that round-off makes.
        error: f64,
    }
}

functions! {
    /// A forward map `y(x) = C' psi(x)`.
    LinearFunctions {
        /// The basis functions at each point, `points x terms`.
        must basis(map: *mut c_void, points: Numbers, basis: *mut f64, answer: *const Answer) -> i32;
        /// The derivative of each basis function (rows) by each parameter (columns) at one point.
        must basis_gradient(map: *mut c_void, point: Numbers, gradient: *mut f64, answer: *const Answer) -> i32;
        /// The form of `|R (psi(x), 1)|^2` for a factor `R` (any number of rows, `terms + 1` columns) that takes
        /// fewer operations than the product; `ABSENT` where there is none. The caller ends it.
        may sum_of_squares(map: *mut c_void, factor: Numbers, out: *mut Squares, answer: *const Answer) -> i32;
    }
}

record! {
    /// A forward map `y(x) = C' psi(x)` with coefficients `C` (`terms x outputs`).
    Linear {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        map: *mut c_void,
        /// What it does.
        functions: *const LinearFunctions,
        /// The coefficients, `terms x outputs`.
        coefficients: Numbers,
    }
}

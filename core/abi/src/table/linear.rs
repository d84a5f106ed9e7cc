//! A forward map that is linear in basis functions.

use std::ffi::c_void;

use super::Numbers;

functions! {
    /// A sum of squares `|R (psi(x), 1)|^2` as a function of the point.
    SquaresFunctions of squares ended by destroy, served by ServeSquares {
        /// The sum at each point.
        must values(points: Numbers, values: *mut f64);
        /// The derivatives at each point, `points x parameters`.
        must gradient(points: Numbers, gradient: *mut f64);
        /// 1 where the form holds at all of these points to its error, else 0.
        must covers(points: Numbers) -> i32;
    }
}

record! {
    /// A sum of squares of linear combinations of basis functions.
    Squares {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        squares: *mut c_void,
        /// The functions.
        functions: *const SquaresFunctions,
        /// The largest difference from the product's own sum of squares that round-off makes.
        error: f64,
    }
}

functions! {
    /// A forward map `y(x) = C' psi(x)`.
    LinearFunctions of map, served by ServeLinear {
        /// The basis functions at each point, `points x terms`.
        must basis(points: Numbers, basis: *mut f64);
        /// The derivative of each basis function (rows) by each parameter (columns) at one point.
        must basis_gradient(point: Numbers, gradient: *mut f64);
        /// The form of `|R (psi(x), 1)|^2` for a factor `R` (any number of rows, `terms + 1` columns) that takes
        /// fewer operations than the product; `ABSENT` where there is none. The caller ends it.
        may sum_of_squares(factor: Numbers, out: *mut Squares);
    }
}

record! {
    /// A forward map `y(x) = C' psi(x)` with coefficients `C` (`terms x outputs`).
    Linear {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        map: *mut c_void,
        /// The functions.
        functions: *const LinearFunctions,
        /// The coefficients, `terms x outputs`.
        coefficients: Numbers,
    }
}

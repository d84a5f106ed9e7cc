//! Operations on numbers, one row per operation with its value and its derivatives.
//!
//! At jumps of a derivative the rows state which value is taken; [the module](super) lists these conventions for users.

use std::f64::consts::{FRAC_2_SQRT_PI, LN_10};

use crate::math::special::digamma;

use crate::math::special::ln_sum_exp;

/// Receives a derivative as a function of the arguments and the value: `slope(x, y, z)`, `z = f(x, y)`.
///
/// A trait instead of a closure, so that every use is compiled separately for every operation and no element of a
/// vector pays for the dispatch.
pub(super) trait Visit {
    fn visit(self, slope: impl Fn(f64, f64, f64) -> f64);
}

/// Values at `L` points, processed together.
pub(super) type Lanes<const L: usize> = [f64; L];

macro_rules! unary {
    ($($name:ident |$x:ident, $z:ident| $value:expr, $slope:expr;)*) => {
        /// An operation on one number.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub(super) enum Unary { $($name,)* }

        impl Unary {
            /// Computes the values of all elements.
            pub fn values<const L: usize>(self, a: &[Lanes<L>], out: &mut [Lanes<L>]) {
                match self { $(Self::$name => map(a, out, |$x: f64| $value),)* }
            }

            /// Passes the derivative to a visitor.
            pub fn slope(self, visitor: impl Visit) {
                match self { $(Self::$name => visitor.visit(|$x: f64, _, $z: f64| {
                    let _ = ($x, $z);
                    $slope
                }),)* }
            }

            /// The value at one number.
            pub fn value(self, at: f64) -> f64 {
                match self { $(Self::$name => {
                    let f = |$x: f64| -> f64 { $value };
                    f(at)
                })* }
            }

            /// The derivative at one number, where the value is `value`.
            pub fn slope_at(self, at: f64, value: f64) -> f64 {
                match self { $(Self::$name => {
                    let f = |$x: f64, $z: f64| -> f64 { let _ = ($x, $z); $slope };
                    f(at, value)
                })* }
            }
        }
    };
}

macro_rules! binary {
    ($($name:ident |$x:ident, $y:ident, $z:ident| $value:expr, $left:expr, $right:expr;)*) => {
        /// An operation on two numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub(super) enum Binary { $($name,)* }

        impl Binary {
            /// Computes the values of all elements; an argument with one element is combined with every element of the
            /// other.
            pub fn values<const L: usize>(
                self,
                a: &[Lanes<L>],
                b: &[Lanes<L>],
                out: &mut [Lanes<L>],
            ) {
                match self { $(Self::$name => zip(a, b, out, |$x: f64, $y: f64| $value),)* }
            }

            /// Passes the derivative by the first argument to a visitor.
            pub fn left_slope(self, visitor: impl Visit) {
                match self { $(Self::$name => visitor.visit(|$x: f64, $y: f64, $z: f64| {
                    let _ = ($x, $y, $z);
                    $left
                }),)* }
            }

            /// Passes the derivative by the second argument to a visitor.
            pub fn right_slope(self, visitor: impl Visit) {
                match self { $(Self::$name => visitor.visit(|$x: f64, $y: f64, $z: f64| {
                    let _ = ($x, $y, $z);
                    $right
                }),)* }
            }

            /// The value at two numbers.
            pub fn value(self, left: f64, right: f64) -> f64 {
                match self { $(Self::$name => {
                    let f = |$x: f64, $y: f64| -> f64 { $value };
                    f(left, right)
                })* }
            }

            /// The derivatives by both numbers, where the value is `value`.
            pub fn slopes_at(self, left: f64, right: f64, value: f64) -> [f64; 2] {
                match self { $(Self::$name => {
                    let f = |$x: f64, $y: f64, $z: f64| -> [f64; 2] {
                        let _ = ($x, $y, $z);
                        [$left, $right]
                    };
                    f(left, right, value)
                })* }
            }
        }
    };
}

unary! {
    Negate |x, z| -x, -1.0;
    Abs |x, z| x.abs(), sign(x);
    Sign |x, z| sign(x), 0.0;
    Square |x, z| x * x, 2.0 * x;
    Cube |x, z| x * x * x, 3.0 * x * x;
    Reciprocal |x, z| 1.0 / x, -z * z;
    Sqrt |x, z| x.sqrt(), 0.5 / z;
    Exp |x, z| x.exp(), z;
    Expm1 |x, z| x.exp_m1(), z + 1.0;
    Log |x, z| x.ln(), 1.0 / x;
    Log10 |x, z| x.log10(), 1.0 / (x * LN_10);
    Log1p |x, z| x.ln_1p(), 1.0 / (1.0 + x);
    Sin |x, z| x.sin(), x.cos();
    Cos |x, z| x.cos(), -x.sin();
    Tan |x, z| x.tan(), 1.0 + z * z;
    Asin |x, z| x.asin(), 1.0 / ((1.0 - x) * (1.0 + x)).sqrt();
    Acos |x, z| x.acos(), -1.0 / ((1.0 - x) * (1.0 + x)).sqrt();
    Atan |x, z| x.atan(), 1.0 / (1.0 + x * x);
    Sinh |x, z| x.sinh(), x.cosh();
    Cosh |x, z| x.cosh(), x.sinh();
    Tanh |x, z| x.tanh(), (1.0 - z) * (1.0 + z);
    Floor |x, z| x.floor(), 0.0;
    Ceil |x, z| x.ceil(), 0.0;
    Erf |x, z| libm::erf(x), FRAC_2_SQRT_PI * (-x * x).exp();
    Erfc |x, z| libm::erfc(x), -FRAC_2_SQRT_PI * (-x * x).exp();
    LogGamma |x, z| libm::lgamma(x), digamma(x);
    Not |x, z| 1.0 - x, 0.0;
}

binary! {
    Add |x, y, z| x + y, 1.0, 1.0;
    Subtract |x, y, z| x - y, 1.0, -1.0;
    Multiply |x, y, z| x * y, y, x;
    Divide |x, y, z| x / y, 1.0 / y, -z / y;
    Power |x, y, z| x.powf(y), if y == 0.0 { 0.0 } else { y * x.powf(y - 1.0) },
        if z == 0.0 { 0.0 } else { z * x.ln() };
    Atan2 |x, y, z| x.atan2(y), planar(y, x, y), -planar(x, x, y);
    Hypot |x, y, z| x.hypot(y), if z == 0.0 { 0.0 } else { x / z },
        if z == 0.0 { 0.0 } else { y / z };
    // An undefined argument must propagate; `f64::min` would return the other one.
    Min |x, y, z| if x <= y || x.is_nan() { x } else { y }, indicator(x <= y), indicator(y < x);
    Max |x, y, z| if x >= y || x.is_nan() { x } else { y }, indicator(x >= y), indicator(y > x);
    LogSumExp |x, y, z| if x.is_nan() || y == f64::INFINITY { x + y } else { ln_sum_exp(x, y) },
        share(x, z), share(y, z);
    Less |x, y, z| compared(x, y, x < y), 0.0, 0.0;
    AtMost |x, y, z| compared(x, y, x <= y), 0.0, 0.0;
    Greater |x, y, z| compared(x, y, x > y), 0.0, 0.0;
    AtLeast |x, y, z| compared(x, y, x >= y), 0.0, 0.0;
    Equal |x, y, z| compared(x, y, x == y), 0.0, 0.0;
    Unequal |x, y, z| compared(x, y, x != y), 0.0, 0.0;
    // Kleene logic: a false side makes `and` false even if the other side is undefined.
    And |x, y, z| if x == 0.0 || y == 0.0 { 0.0 } else { x * y }, 0.0, 0.0;
    Or |x, y, z| if x == 1.0 || y == 1.0 { 1.0 } else { x + y }, 0.0, 0.0;
}

impl Binary {
    pub fn compares(self) -> bool {
        use Binary::{AtLeast, AtMost, Equal, Greater, Less, Unequal};
        matches!(self, Less | AtMost | Greater | AtLeast | Equal | Unequal)
    }

    pub fn joins_conditions(self) -> bool {
        matches!(self, Self::And | Self::Or)
    }
}

/// Value of `if`: NaN if the condition is undefined.
pub(super) fn select(condition: f64, yes: f64, no: f64) -> f64 {
    if condition.is_nan() {
        condition
    } else if condition == 0.0 {
        no
    } else {
        yes
    }
}

fn map<const L: usize>(a: &[Lanes<L>], out: &mut [Lanes<L>], f: impl Fn(f64) -> f64) {
    for (out, a) in out.iter_mut().zip(a) {
        for l in 0..L {
            out[l] = f(a[l]);
        }
    }
}

fn zip<const L: usize>(
    a: &[Lanes<L>],
    b: &[Lanes<L>],
    out: &mut [Lanes<L>],
    f: impl Fn(f64, f64) -> f64,
) {
    let each = |out: &mut Lanes<L>, a: &Lanes<L>, b: &Lanes<L>| {
        for l in 0..L {
            out[l] = f(a[l], b[l]);
        }
    };
    match (a, b) {
        ([a], _) => out.iter_mut().zip(b).for_each(|(out, b)| each(out, a, b)),
        (_, [b]) => out.iter_mut().zip(a).for_each(|(out, a)| each(out, a, b)),
        _ => out.iter_mut().zip(a).zip(b).for_each(|((out, a), b)| each(out, a, b)),
    }
}

/// -1, 0 or 1; NaN for NaN.
fn sign(x: f64) -> f64 {
    if x == 0.0 || x.is_nan() { x } else { x.signum() }
}

fn indicator(condition: bool) -> f64 {
    f64::from(u8::from(condition))
}

/// Result of a comparison: NaN if a side is NaN.
fn compared(x: f64, y: f64, outcome: bool) -> f64 {
    if x.is_nan() || y.is_nan() { f64::NAN } else { indicator(outcome) }
}

/// Derivative of `z` by `x` for `z = log(exp(x) + ...)`: `exp(x - z)`, the fraction of `exp(x)` in `exp(z)`.
fn share(x: f64, z: f64) -> f64 {
    if x == z { 1.0 } else { (x - z).exp() }
}

/// `part / (x^2 + y^2)`, zero at the origin.
fn planar(part: f64, x: f64, y: f64) -> f64 {
    let square = x * x + y * y;
    if square == 0.0 { 0.0 } else { part / square }
}

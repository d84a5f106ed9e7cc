//! Number types for log densities: plain numbers, and dual numbers that carry their derivatives.

#![allow(clippy::suspicious_arithmetic_impl, reason = "rules of products and quotients")]

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Operations on numbers that log densities need.
pub trait Real:
    Copy
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The value without its derivatives.
    fn number(self) -> f64;
    fn exp(self) -> Self;
    fn ln(self) -> Self;
    fn sqrt(self) -> Self;
}

impl Real for f64 {
    fn number(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        self.exp()
    }
    fn ln(self) -> Self {
        self.ln()
    }
    fn sqrt(self) -> Self {
        self.sqrt()
    }
}

/// Number of derivatives: that of the parameters of the largest posterior.
const SLOPES: usize = 10;

/// A number with its derivatives by all unknowns.
#[derive(Clone, Copy, Debug)]
pub struct Dual {
    pub value: f64,
    pub slopes: [f64; SLOPES],
}

impl Dual {
    /// The unknown with this index.
    pub fn unknown(value: f64, index: usize) -> Self {
        Self { value, slopes: from_fn(|j| if j == index { 1.0 } else { 0.0 }) }
    }

    fn chain(self, value: f64, slope: f64) -> Self {
        Self { value, slopes: self.slopes.map(|s| s * slope) }
    }
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self { value, slopes: [0.0; SLOPES] }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let slopes = from_fn(|j| self.slopes[j] + other.slopes[j]);
        Self { value: self.value + other.value, slopes }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        let slopes = from_fn(|j| self.slopes[j] - other.slopes[j]);
        Self { value: self.value - other.value, slopes }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let slopes = from_fn(|j| self.slopes[j] * other.value + self.value * other.slopes[j]);
        Self { value: self.value * other.value, slopes }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let slopes = from_fn(|j| (self.slopes[j] - value * other.slopes[j]) / other.value);
        Self { value, slopes }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl Real for Dual {
    fn number(self) -> f64 {
        self.value
    }
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }
    fn ln(self) -> Self {
        self.chain(self.value.ln(), 1.0 / self.value)
    }
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        self.chain(value, 0.5 / value)
    }
}

//! Logarithms of probability densities, expanded into simpler operations.
//!
//! Parameters are those of [`Distribution`](crate::math::distribution::Distribution). Outside the support the value is
//! minus infinity; for invalid parameters it is NaN.

use super::Compiler;
use super::value::Value;
use crate::expression::function::Density;
use crate::expression::operator::{Binary, Unary};
use crate::math::special::HALF_LN_TWO_PI;

impl Compiler {
    /// The log density of arguments whose shapes fit.
    pub(super) fn density(&mut self, density: Density, arguments: &[Value]) -> Value {
        match (density, arguments) {
            (Density::Normal, &[x, mean, sd]) => self.normal(x, mean, sd),
            (Density::LogNormal, &[x, mu, sigma]) => {
                let log = self.unary(Unary::Log, x);
                let normal = self.normal(log, mu, sigma);
                let value = self.minus(normal, log);
                self.above_zero(x, value)
            }
            (Density::StudentT, &[x, degrees, location, scale]) => {
                self.student_t(x, degrees, location, scale)
            }
            (Density::Cauchy, &[x, location, scale]) => {
                let z = self.standardised(x, location, scale);
                let square = self.unary(Unary::Square, z);
                let tail = self.unary(Unary::Log1p, square);
                let log_scale = self.unary(Unary::Log, scale);
                let log_pi = self.number(std::f64::consts::PI.ln());
                let norm = self.plus(log_scale, log_pi);
                let sum = self.plus(tail, norm);
                self.unary(Unary::Negate, sum)
            }
            (Density::Exponential, &[x, mean]) => {
                let ratio = self.over(x, mean);
                let log_mean = self.unary(Unary::Log, mean);
                let sum = self.plus(ratio, log_mean);
                let value = self.unary(Unary::Negate, sum);
                let inside = self.compare(Binary::AtLeast, x, 0.0);
                self.supported(inside, value)
            }
            (Density::Gamma, &[x, shape, scale]) => self.gamma(x, shape, scale),
            (Density::InverseGamma, &[x, shape, scale]) => self.inverse_gamma(x, shape, scale),
            (Density::Beta, &[x, a, b]) => self.beta(x, a, b),
            (Density::Uniform, &[x, lower, upper]) => {
                let width = self.minus(upper, lower);
                let log_width = self.unary(Unary::Log, width);
                let value = self.unary(Unary::Negate, log_width);
                let above = self.binary(Binary::AtLeast, x, lower);
                let below = self.binary(Binary::AtMost, x, upper);
                let inside = self.binary(Binary::And, above, below);
                self.supported(inside, value)
            }
            (Density::Poisson, &[count, mean]) => self.poisson(count, mean),
            (Density::Binomial, &[count, trials, probability]) => {
                self.binomial(count, trials, probability)
            }
            _ => unreachable!("arity is checked"),
        }
    }

    fn plus(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Add, a, b)
    }

    fn minus(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Subtract, a, b)
    }

    fn times(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Multiply, a, b)
    }

    fn over(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Divide, a, b)
    }

    fn shifted(&mut self, a: Value, by: f64) -> Value {
        let by = self.number(by);
        self.plus(a, by)
    }

    fn scaled(&mut self, a: Value, by: f64) -> Value {
        let by = self.number(by);
        self.times(by, a)
    }

    fn standardised(&mut self, x: Value, location: Value, scale: Value) -> Value {
        let difference = self.minus(x, location);
        self.over(difference, scale)
    }

    fn compare(&mut self, comparison: Binary, x: Value, with: f64) -> Value {
        let with = self.number(with);
        self.binary(comparison, x, with)
    }

    /// The value inside the support, minus infinity outside.
    fn supported(&mut self, inside: Value, value: Value) -> Value {
        let outside = self.number(f64::NEG_INFINITY);
        self.select(inside, value, outside)
    }

    fn above_zero(&mut self, x: Value, value: Value) -> Value {
        let inside = self.compare(Binary::Greater, x, 0.0);
        self.supported(inside, value)
    }

    /// `factor log(x)`, zero if the factor is zero.
    fn times_log(&mut self, factor: Value, log: Value) -> Value {
        let none = self.compare(Binary::Equal, factor, 0.0);
        let product = self.times(factor, log);
        let zero = self.number(0.0);
        self.select(none, zero, product)
    }

    fn log_gamma(&mut self, x: Value) -> Value {
        self.unary(Unary::LogGamma, x)
    }

    /// `log(1 - x)`
    fn log_complement(&mut self, x: Value) -> Value {
        let negative = self.unary(Unary::Negate, x);
        self.unary(Unary::Log1p, negative)
    }

    fn normal(&mut self, x: Value, mean: Value, sd: Value) -> Value {
        let z = self.standardised(x, mean, sd);
        let square = self.unary(Unary::Square, z);
        let exponent = self.scaled(square, -0.5);
        let log_sd = self.unary(Unary::Log, sd);
        let norm = self.shifted(log_sd, HALF_LN_TWO_PI);
        self.minus(exponent, norm)
    }

    /// `lgamma((n+1)/2) - lgamma(n/2) - log(n pi)/2 - log s - (n+1)/2 log(1 + z²/n)`
    fn student_t(&mut self, x: Value, degrees: Value, location: Value, scale: Value) -> Value {
        let z = self.standardised(x, location, scale);
        let square = self.unary(Unary::Square, z);
        let ratio = self.over(square, degrees);
        let tail = self.unary(Unary::Log1p, ratio);
        let half = self.scaled(degrees, 0.5);
        let above = self.shifted(half, 0.5);
        let (gamma, gamma_above) = (self.log_gamma(half), self.log_gamma(above));
        let area = self.scaled(degrees, std::f64::consts::PI);
        let log_area = self.unary(Unary::Log, area);
        let half_log_area = self.scaled(log_area, 0.5);
        let log_scale = self.unary(Unary::Log, scale);
        let difference = self.minus(gamma_above, gamma);
        let less = self.minus(difference, half_log_area);
        let norm = self.minus(less, log_scale);
        let weighted = self.times(above, tail);
        self.minus(norm, weighted)
    }

    /// `(k-1) log x - x/s - lgamma(k) - k log s`
    fn gamma(&mut self, x: Value, shape: Value, scale: Value) -> Value {
        let log = self.unary(Unary::Log, x);
        let power = self.shifted(shape, -1.0);
        let rise = self.times(power, log);
        let ratio = self.over(x, scale);
        let kernel = self.minus(rise, ratio);
        let log_scale = self.unary(Unary::Log, scale);
        let scaled = self.times(shape, log_scale);
        let gamma = self.log_gamma(shape);
        let norm = self.plus(gamma, scaled);
        let value = self.minus(kernel, norm);
        self.above_zero(x, value)
    }

    /// `k log s - lgamma(k) - (k+1) log x - s/x`
    fn inverse_gamma(&mut self, x: Value, shape: Value, scale: Value) -> Value {
        let log = self.unary(Unary::Log, x);
        let power = self.shifted(shape, 1.0);
        let fall = self.times(power, log);
        let ratio = self.over(scale, x);
        let kernel = self.plus(fall, ratio);
        let log_scale = self.unary(Unary::Log, scale);
        let scaled = self.times(shape, log_scale);
        let gamma = self.log_gamma(shape);
        let norm = self.minus(scaled, gamma);
        let value = self.minus(norm, kernel);
        self.above_zero(x, value)
    }

    /// `(a-1) log x + (b-1) log(1-x) + lgamma(a+b) - lgamma(a) - lgamma(b)`
    fn beta(&mut self, x: Value, a: Value, b: Value) -> Value {
        let (log, complement) = (self.unary(Unary::Log, x), self.log_complement(x));
        let (left, right) = (self.shifted(a, -1.0), self.shifted(b, -1.0));
        let (rise, fall) = (self.times_log(left, log), self.times_log(right, complement));
        let kernel = self.plus(rise, fall);
        let total = self.plus(a, b);
        let (all, of_a, of_b) = (self.log_gamma(total), self.log_gamma(a), self.log_gamma(b));
        let parts = self.plus(of_a, of_b);
        let norm = self.minus(all, parts);
        let value = self.plus(kernel, norm);
        let above = self.compare(Binary::Greater, x, 0.0);
        let below = self.compare(Binary::Less, x, 1.0);
        let inside = self.binary(Binary::And, above, below);
        self.supported(inside, value)
    }

    /// The condition that `x` is a non-negative integer.
    fn is_count(&mut self, x: Value) -> Value {
        let floor = self.unary(Unary::Floor, x);
        let whole = self.binary(Binary::Equal, x, floor);
        let from_zero = self.compare(Binary::AtLeast, x, 0.0);
        self.binary(Binary::And, whole, from_zero)
    }

    /// `lgamma(x + 1)`
    fn log_factorial(&mut self, x: Value) -> Value {
        let next = self.shifted(x, 1.0);
        self.log_gamma(next)
    }

    /// `k log m - m - log k!`
    fn poisson(&mut self, count: Value, mean: Value) -> Value {
        let log = self.unary(Unary::Log, mean);
        let rise = self.times_log(count, log);
        let kernel = self.minus(rise, mean);
        let factorial = self.log_factorial(count);
        let value = self.minus(kernel, factorial);
        let inside = self.is_count(count);
        self.supported(inside, value)
    }

    /// `log n! - log k! - log (n-k)! + k log p + (n-k) log(1-p)`
    fn binomial(&mut self, count: Value, trials: Value, probability: Value) -> Value {
        let failures = self.minus(trials, count);
        let log = self.unary(Unary::Log, probability);
        let complement = self.log_complement(probability);
        let (hits, misses) = (self.times_log(count, log), self.times_log(failures, complement));
        let kernel = self.plus(hits, misses);
        let all = self.log_factorial(trials);
        let (of_hits, of_misses) = (self.log_factorial(count), self.log_factorial(failures));
        let parts = self.plus(of_hits, of_misses);
        let choices = self.minus(all, parts);
        let value = self.plus(choices, kernel);
        let (whole, rest) = (self.is_count(count), self.is_count(failures));
        let inside = self.binary(Binary::And, whole, rest);
        self.supported(inside, value)
    }
}

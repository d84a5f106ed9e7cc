//! `time_warp`: a time that runs faster in one place and slower in another.

mod map;

use std::f64::consts::SQRT_2;

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Context;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, each_curve,
};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Knots, sampled};
use map::Map;

/// A warp of time: time runs faster in one part of a curve and slower in another.
///
/// Curves whose features come at other times than in the model are registered: the times are aligned before the
/// heights are compared. Without the warp the parameters compensate the differences of height that a difference of time
/// produces, and the peaks are flattened.
///
/// ```text
/// y(t) → y(w(t)),   log w'(t) = deviation · Σ_k √2 s_k cos(k π u) + constant
/// ```
///
/// `u` runs from 0 to 1 along the curve, and the constant keeps the last time where it is: the warp `w` is increasing
/// whatever its unknowns are, and both ends of the curve stay. A shift is the effect `delay` and a uniform stretch is
/// `clock_rate`; put them before or after the warp. The `s_k` are the direction of the vector `shape[k] / k`: divided
/// by its length, so that `deviation` alone is the size of the warp (0.01 added to the squared length keeps the warp
/// smooth where all shapes are zero). The length of the vector of shapes remains as uncertain as its prior. Of the
/// samplers `no_u_turn` suits it best.
///
/// The logarithm of the rate is as in Ramsay and Silverman, Functional Data Analysis (2005), chapter 7; the weights
/// `1/k` are those of the cosines of a Brownian motion about its mean over the curve (Karhunen–Loève expansion).
///
/// With a slope of the curve of zero nothing is known about the warp: a curve without features determines none of the
/// shapes, whose posteriors are then their priors. One warp serves all curves on which the effect acts; write one
/// effect for each group of curves with clocks of their own (`on`). Between its points a curve is interpolated by a
/// cubic spline, as for `delay`.
///
/// It is easily confused with `delay`, `clock_rate`, and parameters that set the times of features. The search for
/// missing effects does not propose it: a warp reproduces many a difference that has another cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TimeWarp {
    /// Prior of the standard deviation of the logarithm of the rate along the curve, a number: with 0.2, time runs
    /// about 20 % faster in one part and 20 % slower in another.
    pub deviation: Distribution,
    /// Number of unknown shapes, 1 to 8. Each has the standard normal prior and is named `shape[1]`, `shape[2]`, …; the
    /// shape `k` has `k` half-waves along the curve.
    pub shapes: usize,
}

impl Default for TimeWarp {
    fn default() -> Self {
        Self { deviation: Distribution::HalfNormal(0.2), shapes: 3 }
    }
}

/// Names and symbols of the shapes.
const SHAPES: [(&str, &str); 8] = [
    ("shape[1]", "z1"),
    ("shape[2]", "z2"),
    ("shape[3]", "z3"),
    ("shape[4]", "z4"),
    ("shape[5]", "z5"),
    ("shape[6]", "z6"),
    ("shape[7]", "z7"),
    ("shape[8]", "z8"),
];

/// The prior of a shape.
const SHAPE: Distribution = Distribution::Normal([0.0, 1.0]);

/// The warp of curves on a grid, and the direction of its logarithmic rate.
fn warp(knots: &Knots<'_>, values: &[f64]) -> (Map, Direction) {
    let direction = Direction::new(&values[1..]);
    let coefficients: Vec<f64> = direction.along.iter().map(|s| values[0] * s).collect();
    (Map::new(knots.at, &coefficients), direction)
}

/// The direction of the vector of shapes, `√2 s_k`, of which the squares of the `s_k` add to one.
struct Direction {
    /// The numbers themselves.
    along: Vec<f64>,
    /// Length of the vector `shape[k] / k`.
    length: f64,
}

/// Added to the squared length of the vector, whose direction is not defined at zero.
const SMOOTHED: f64 = 0.01;

impl Direction {
    fn new(shapes: &[f64]) -> Self {
        let vector = shapes.iter().enumerate().map(|(k, z)| z / (k + 1) as f64);
        let length = (vector.clone().map(|v| v * v).sum::<f64>() + SMOOTHED).sqrt();
        Self { along: vector.map(|v| SQRT_2 * v / length).collect(), length }
    }

    /// Derivatives by the shapes of what has these derivatives by the direction.
    fn by_shapes(&self, by_along: &[f64]) -> Vec<f64> {
        let radial = by_along.iter().zip(&self.along).map(|(b, s)| b * s).sum::<f64>();
        let one = |(k, (by, along)): (usize, (&f64, &f64))| {
            (SQRT_2 * by - radial * along / SQRT_2) / (self.length * (k + 1) as f64)
        };
        by_along.iter().zip(&self.along).enumerate().map(one).collect()
    }
}

impl CurveEffect for TimeWarp {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "a warp of time: curves whose features come at other times",
            "y(w(t)), log w' = deviation · Σ √2 s_k cos(k π u) + constant",
            "Ramsay and Silverman, Functional Data Analysis (2005), chapter 7",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        let example = "{ half_normal = 0.2 }";
        let size = Unknown::new("deviation", "δ", Measure::Number, &self.deviation, example);
        let shape = |(name, symbol): &(&'static str, &'static str)| {
            Unknown::new(name, symbol, Measure::Number, &SHAPE, "{ normal = [0, 1] }")
        };
        let shapes = SHAPES.iter().take(self.shapes).map(shape);
        std::iter::once(size.not_negative()).chain(shapes).collect()
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        if values[0] == 0.0 {
            return response.to_vec();
        }
        let knots = Knots::of(layout);
        let (map, _) = warp(&knots, values);
        each_curve(layout, response, |y, out| {
            sampled(&knots, y, &knots.slopes(y), |i| map.to[i], |i, value, _| out[i] = value);
        })
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let (map, direction) = warp(&knots, values);
        let slopes = each_curve(layout, response, |y, out| {
            sampled(&knots, y, &knots.slopes(y), |i| map.to[i], |i, _, slope| out[i] = slope);
        });
        let of_place = |by: &[f64]| {
            let by_size = by.iter().zip(&direction.along).map(|(b, s)| b * s).sum::<f64>();
            let by_along: Vec<f64> = by.iter().map(|b| values[0] * b).collect();
            [vec![by_size], direction.by_shapes(&by_along)].concat()
        };
        let places: Vec<Vec<f64>> = map.by.iter_rows().map(of_place).collect();
        Matrix::from_fn(response.len(), values.len(), |i, j| {
            slopes[i] * places[i % places.len()][j]
        })
    }

    /// Each of the first three shapes in either direction; the rest are small.
    fn indices(&self, _: &Layout) -> Option<Vec<Vec<f64>>> {
        let of = |k: usize| if k < 3 { vec![-1.0, 1.0] } else { vec![0.0] };
        Some((0..self.shapes).map(of).collect())
    }

    fn proposals(&self, _: &Situation<'_>) -> Vec<Table> {
        Vec::new()
    }

    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        if !(1..=SHAPES.len()).contains(&self.shapes) {
            complaints
                .at("shapes")
                .say("the number of shapes is out of range")
                .expected(format!("1 to {}", SHAPES.len()))
                .found(self.shapes);
        }
    }
}

lacuna::register!(Effect, "time_warp", TimeWarp);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    /// A bump whose warped form is known: `y(w(t))` with the warp read off a straight line.
    #[test]
    fn a_bump_is_seen_through_the_warp() {
        let times = even(121, 0.5);
        let layout = curve(times.clone());
        let warp = effect("time_warp", "shapes = 2");
        let values = [0.3, 1.2, -0.7];
        let seen = warp.apply(&layout, &times, &values);
        assert!(seen.windows(2).all(|w| w[0] < w[1]) && seen != times);
        let bump = |t: f64| (-0.5 * ((t - 25.0) / 3.0).powi(2)).exp();
        let response: Vec<f64> = times.iter().map(|t| bump(*t)).collect();
        let found = warp.apply(&layout, &response, &values);
        let exact = |t: f64| bump(seen[(t / 0.5) as usize]);
        assert!(largest(&found, &times, 0..121, exact) < 1e-4);
    }

    /// The standard deviation of the logarithmic rate along the curve is `deviation`, whatever the shapes are.
    #[test]
    fn deviation_is_that_of_the_logarithmic_rate() {
        let times = even(201, 1.0);
        let (layout, warp) = (curve(times.clone()), effect("time_warp", ""));
        for shapes in [[3.0, 0.0, 0.0], [-4.0, 5.0, 2.0], [0.5, -8.0, 9.0]] {
            let seen = warp.apply(&layout, &times, &[&[0.1], &shapes[..]].concat());
            let rates: Vec<f64> = seen.windows(2).map(|w| (w[1] - w[0]).ln()).collect();
            let mean = rates.iter().sum::<f64>() / 200.0;
            let square = rates.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 200.0;
            assert!((square.sqrt() - 0.1).abs() < 1e-3, "{shapes:?}: {}", square.sqrt());
        }
    }
}

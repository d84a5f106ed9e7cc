//! Posteriors of posteriordb (Magnusson et al., github.com/stan-dev/posteriordb, commit 28f8d3d) as targets.
//!
//! The log densities are those that posteriordb's Stan programs define, including priors, in natural units and so
//! without the Jacobians of Stan's transformations; each is written once over `Real` numbers, and dual numbers give
//! the gradient. Solutions of differential equations are differentiated step by step.
//!
//! They are a crate of their own because samplers spend nearly all of their time in these densities, and the tests are
//! compiled almost without optimisation.

#![allow(clippy::unwrap_used, reason = "the files are part of the program")]

mod linear;
mod mixture;
mod pharmacology;
mod populations;
mod process;
mod real;
mod schools;
mod series;

use std::sync::Arc;

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Component;
use lacuna::plugin::density::{BoundDensity, Density};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use serde_json::Value;

use real::{Dual, Real};

/// A posterior with published reference values.
pub struct Posterior {
    /// Name in posteriordb, such as `sblrc-blr`.
    pub name: &'static str,
    /// Sampled unknowns. Their priors serve for starting points and bounds: the density includes the priors of the Stan
    /// program.
    pub parameters: Vec<Parameter>,
    /// The posterior density.
    pub density: Box<dyn Density>,
    /// Maps a sampled point to the quantities with published values, in the order of `reference`.
    pub reported: fn(&[f64]) -> Vec<f64>,
    /// Published reference values.
    pub reference: Vec<Reference>,
}

/// Published values of one quantity.
pub struct Reference {
    /// Name of the quantity.
    pub name: String,
    /// Mean of the reference draws.
    pub mean: f64,
    /// Standard deviation of the reference draws.
    pub sd: f64,
    /// Monte Carlo error of the mean.
    pub mean_error: f64,
}

/// All posteriors, in the order of their names.
pub fn posteriors() -> Vec<Posterior> {
    let mut all = linear::posteriors();
    all.extend(series::posteriors());
    all.extend([
        schools::posterior(),
        mixture::posterior(),
        process::posterior(),
        populations::posterior(),
        pharmacology::posterior(),
    ]);
    all.sort_by_key(|posterior| posterior.name);
    all
}

/// A log density over any type of number; outside the support it is not finite.
trait Model: Send + Sync + 'static {
    fn log_density<R: Real>(&self, point: &[R]) -> R;
}

/// A model as a target.
struct Natural<M>(Arc<M>);

impl<M: Model> Component for Natural<M> {}

impl<M: Model> Density for Natural<M> {
    fn bind(&self, _: &[Parameter]) -> Result<Box<dyn BoundDensity>, Stop> {
        Ok(Box::new(Self(self.0.clone())))
    }

    fn includes_prior(&self) -> bool {
        true
    }
}

impl<M: Model> BoundDensity for Natural<M> {
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let finite = |value: f64| if value.is_finite() { value } else { f64::NEG_INFINITY };
        points.iter_rows().map(|point| finite(self.0.log_density(point))).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let duals: Vec<Dual> =
            point.iter().enumerate().map(|(j, x)| Dual::unknown(*x, j)).collect();
        let result = self.0.log_density(&duals);
        if result.value.is_finite() {
            (result.value, result.slopes[..point.len()].to_vec())
        } else {
            (f64::NEG_INFINITY, vec![0.0; point.len()])
        }
    }
}

/// File of a posterior.
struct File {
    name: &'static str,
    content: Value,
}

impl File {
    fn new(name: &'static str, text: &str) -> Self {
        Self { name, content: serde_json::from_str(text).unwrap() }
    }

    fn number(&self, key: &str) -> f64 {
        self.content["data"][key].as_f64().unwrap()
    }

    fn vector(&self, key: &str) -> Vec<f64> {
        numbers(&self.content["data"][key])
    }

    fn rows(&self, key: &str) -> Vec<Vec<f64>> {
        self.content["data"][key].as_array().unwrap().iter().map(numbers).collect()
    }

    /// A posterior whose published quantities are the sampled ones.
    fn posterior<M: Model>(self, model: M, parameters: Vec<(&str, Distribution)>) -> Posterior {
        let parameter = |(name, prior): (&str, Distribution)| Parameter::plain(name, prior);
        let reference = self.content["reference"].as_object().unwrap().iter().map(|(name, f)| {
            let figure = |key: &str| f[key].as_f64().unwrap();
            Reference {
                name: name.clone(),
                mean: figure("mean"),
                sd: figure("sd"),
                mean_error: figure("mcse_mean"),
            }
        });
        Posterior {
            name: self.name,
            reference: reference.collect(),
            parameters: parameters.into_iter().map(parameter).collect(),
            density: Box::new(Natural(Arc::new(model))),
            reported: <[f64]>::to_vec,
        }
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The file with this name.
macro_rules! file {
    ($name:literal) => {
        super::File::new($name, include_str!(concat!("../data/", $name, ".json")))
    };
}
use file;

/// Logarithm of a normal density, without its constant.
fn normal<R: Real>(x: R, mean: R, sd: R) -> R {
    let z = (x - mean) / sd;
    z * z * R::from(-0.5) - sd.ln()
}

/// Like [`normal`], with constant mean and standard deviation.
fn normal_prior<R: Real>(x: R, mean: f64, sd: f64) -> R {
    normal(x, R::from(mean), R::from(sd))
}

/// Logarithm of a Cauchy density around zero on positive numbers, without its constant.
fn half_cauchy<R: Real>(x: R, scale: f64) -> R {
    let z = x / R::from(scale);
    positive(x) - (z * z + R::from(1.0)).ln()
}

/// Zero for a positive number, minus infinity for others.
fn positive<R: Real>(x: R) -> R {
    R::from(if x.number() > 0.0 { 0.0 } else { f64::NEG_INFINITY })
}

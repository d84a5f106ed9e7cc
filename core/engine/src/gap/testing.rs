//! Synthetic experiments for tests: responses that are linear in their parameters, with a known noise model.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Layouts, Measurements, Observations, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna_linalg::{Matrix, multiply, transposed_multiply_vector};

use super::experiment::Experiment;
use super::noise::{Autoregression, CurveNoise, Noise, Origin, ReplicateVariation};

/// A response that is linear in its parameters.
pub struct LinearModel {
    /// The slopes, one parameter a row.
    pub slopes: Matrix,
}

impl Forward for LinearModel {
    fn dimension(&self) -> usize {
        self.slopes.rows()
    }
    fn outputs(&self) -> usize {
        self.slopes.columns()
    }
    fn mean(&self, points: &Matrix) -> Matrix {
        multiply(points, &self.slopes)
    }
    fn jacobian(&self, _: &[f64]) -> Matrix {
        self.slopes.transposed()
    }
}

/// A linear world: conditions by sensors by times.
pub struct SyntheticExperiment {
    pub layouts: Layouts,
    pub parameters: Vec<Parameter>,
    pub forward: LinearModel,
    pub noise: Noise,
}

impl SyntheticExperiment {
    /// With parameters of standard normal priors and autoregressive noise of coefficient `memory` whose innovations
    /// have variance one; `slope(parameter, condition, sensor, time)`.
    pub fn new(
        conditions: &[&str],
        sensors: &[&str],
        times: usize,
        memory: f64,
        names: &[&str],
        slope: impl Fn(usize, usize, usize, f64) -> f64,
    ) -> Self {
        let layout = || {
            let at = (0..times).map(|t| t as f64).collect();
            let grid = Axis::grid("time", at, Unit::parse("s").unwrap());
            let axes = vec![Axis::labels("sensor", sensors.to_vec()), grid];
            Layout { name: "y".into(), unit: Unit::parse("m").unwrap(), axes }
        };
        let layouts = Layouts::of_scenarios(conditions.iter().map(|c| (*c, layout())));
        let law = Distribution::Normal([0.0, 1.0]);
        let parameter = |name: &&str| Parameter {
            name: (*name).into(),
            symbol: (*name).into(),
            unit: Unit::dimensionless(),
            design: law.clone(),
            prior: law.clone(),
            reference: None,
        };
        let place =
            |i: usize| (i / (times * sensors.len()), i / times % sensors.len(), (i % times) as f64);
        let slopes = Matrix::from_fn(names.len(), layouts.len(), |j, i| {
            let (c, s, t) = place(i);
            slope(j, c, s, t)
        });
        let memory = Autoregression::of_autocovariances(&[1.0, memory], 1).0;
        let curve = CurveNoise {
            sd: 1.0,
            memory,
            level: 0.0,
            wander: ReplicateVariation::default(),
            profile: vec![1.0; times],
        };
        let curves = conditions.len() * sensors.len();
        let noise = Noise {
            curves: vec![curve; curves],
            shared: vec![ReplicateVariation::default(); conditions.len()],
            across: vec![None; conditions.len()],
            origins: vec![Origin::Stated; curves],
        };
        let parameters = names.iter().map(parameter).collect();
        Self { layouts, parameters, forward: LinearModel { slopes }, noise }
    }

    /// The response at a point.
    pub fn response(&self, point: &[f64]) -> Vec<f64> {
        transposed_multiply_vector(&self.forward.slopes, point)
    }

    /// An experiment of so many replicates a condition around a truth.
    pub fn experiment(&self, truth: &[f64], replicates: usize, stream: &Stream) -> Experiment<'_> {
        let layout = self.layouts.blocks[0].clone();
        let empty = |r: usize| Replicate::new(r.to_string(), vec![Some(0.0); truth.len()]);
        let data: Observations =
            Measurements::new(layout, (0..replicates).map(empty).collect()).into();
        let experiment = Experiment::new(&self.layouts, &self.parameters, &self.forward, &data);
        let replicates = self.noise.simulate(&experiment, truth, stream);
        experiment.with_replicates(replicates)
    }
}

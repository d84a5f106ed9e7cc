//! Replicates simulated from the noise model.

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::Matrix;

use super::{Noise, directions};
use crate::gap::experiment::Experiment;

impl Noise {
    /// Simulates replicates around a response: for each condition as many as the experiment has, with values where
    /// those have values, in the response's unit.
    pub fn simulate(
        &self,
        experiment: &Experiment<'_>,
        response: &[f64],
        stream: &Stream,
    ) -> Vec<Vec<Vec<Option<f64>>>> {
        let conditions = experiment.conditions.iter().enumerate();
        conditions
            .map(|(c, condition)| {
                let stream = stream.at(c as u64);
                let replicates = condition.replicates.iter().enumerate();
                replicates
                    .map(|(r, pattern)| {
                        let new = self.replicate(experiment, c, response, &stream.at(r as u64));
                        pattern.iter().zip(new).map(|(old, new)| old.map(|_| new)).collect()
                    })
                    .collect()
            })
            .collect()
    }

    /// A draw from the part of the emulator's error outside the span of its factors, one value an output, in the
    /// response's unit.
    pub fn independent(&self, experiment: &Experiment<'_>, stream: &Stream) -> Vec<f64> {
        let mut all = vec![0.0; experiment.outputs()];
        if experiment.independent.iter().all(|v| *v <= 0.0) {
            return all;
        }
        for (c, condition) in experiment.conditions.iter().enumerate() {
            let mut rng = stream.at(c as u64).generator();
            let curves = &experiment.curves[condition.curves.clone()];
            let mut white: Vec<Vec<f64>> = curves
                .iter()
                .map(|curve| curve.measured.iter().map(|_| normal(&mut rng)).collect())
                .collect();
            if let Some(factor) = &self.across[c] {
                correlate(factor, &mut white);
            }
            for ((curve, values), s) in curves.iter().zip(&mut white).zip(condition.curves.clone())
            {
                self.curves[s].succession(curve).colour(values);
                for (&i, x) in curve.measured.iter().zip(values) {
                    all[i] = experiment.independent[i].sqrt() * *x;
                }
            }
        }
        all
    }

    /// One new replicate of a condition around a response.
    fn replicate(
        &self,
        experiment: &Experiment<'_>,
        c: usize,
        response: &[f64],
        stream: &Stream,
    ) -> Vec<f64> {
        let condition = &experiment.conditions[c];
        let mut rng = stream.generator();
        let shared = self.shared[c].variances().map(|v| v.sqrt() * normal(&mut rng));
        let mut white: Vec<Vec<f64>> = experiment.curves[condition.curves.clone()]
            .iter()
            .map(|curve| curve.measured.iter().map(|_| normal(&mut rng)).collect())
            .collect();
        if let Some(factor) = &self.across[c] {
            correlate(factor, &mut white);
        }
        let mut values: Vec<f64> = response[condition.outputs.clone()].to_vec();
        for (s, mut noise) in condition.curves.clone().zip(white) {
            let (curve, law) = (&experiment.curves[s], &self.curves[s]);
            law.succession(curve).colour(&mut noise);
            let own: Vec<f64> = curve.measured.iter().map(|&i| response[i]).collect();
            let directions = directions(&own, &curve.at);
            let wander: Vec<f64> = law
                .wander
                .variances()
                .iter()
                .zip(shared)
                .map(|(v, shared)| v.sqrt() * normal(&mut rng) + shared)
                .collect();
            for (k, &i) in curve.measured.iter().enumerate() {
                let moved: f64 = (0..3).map(|d| wander[d] * directions[d][k]).sum();
                values[i - condition.outputs.start] += law.sd * law.profile[k] * noise[k] + moved;
            }
        }
        values
    }
}

/// Correlates white curves with a lower factor, in place.
fn correlate(factor: &Matrix, curves: &mut [Vec<f64>]) {
    for t in 0..curves[0].len() {
        for i in (0..curves.len()).rev() {
            let value = (0..=i).map(|j| factor[(i, j)] * curves[j][t]).sum();
            curves[i][t] = value;
        }
    }
}

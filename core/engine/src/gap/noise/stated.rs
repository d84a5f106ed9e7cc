//! Noise that a study states about a curve without replicates.

use super::{Autoregression, CurveNoise, ReplicateVariation};
use crate::gap::experiment::MeasuredCurve;
use crate::gap::experiment::stated::Statement;

/// The smallest standard deviation relative to the mean one: stated noise can be zero where the response is zero.
const SMALLEST: f64 = 1e-6;

/// The statement about one curve.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct CurveStatement {
    /// The standard deviation of each measured value, in the response's unit.
    pub sd: Option<Vec<f64>>,
    /// The autocorrelation.
    pub memory: Option<Autoregression>,
}

impl CurveStatement {
    /// The part of a statement about a curve.
    pub fn of(all: &Statement, curve: &MeasuredCurve) -> Self {
        let sd: Option<Vec<f64>> = curve.measured.iter().map(|&i| all.outputs[i].sd).collect();
        let time = curve.measured.first().and_then(|&i| all.outputs[i].memory);
        let memory = time.map(|time| {
            if time > 0.0 {
                Autoregression::of_reflections(&[(-curve.step() / time).exp()])
            } else {
                Autoregression::white()
            }
        });
        Self { sd: sd.filter(|sd| !sd.is_empty()), memory }
    }

    /// The noise of a curve of this size with a memory; `None` if the size is not stated.
    pub fn with(&self, memory: Autoregression) -> Option<CurveNoise> {
        let (mean, profile) = self.size()?;
        Some(CurveNoise {
            sd: mean / memory.variance().sqrt(),
            memory,
            level: 0.0,
            wander: ReplicateVariation::default(),
            profile,
        })
    }

    /// The root mean square of the standard deviations, and each of them relative to it.
    pub fn size(&self) -> Option<(f64, Vec<f64>)> {
        let sd = self.sd.as_ref()?;
        let squares = sd.iter().map(|s| s * s).sum::<f64>();
        let mean = (squares / sd.len().max(1) as f64).sqrt();
        Some((mean, sd.iter().map(|s| (s / mean).max(SMALLEST)).collect()))
    }
}

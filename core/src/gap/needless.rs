//! What of the study's own is not needed beside what was found: terms and effects without which the data are more probable.
//!
//! A term of the study's that stood in for what was missing is compatible with zero once that is there. The odds are those of the
//! same explanation with and without it, each after its own calibration under the same noise.

use serde::{Deserialize, Serialize};

use super::experiment::Experiment;
use super::fit::fit;
use super::name::{Found, weigh};
use super::system::System;
use super::wide::Wide;
use crate::data::Parameter;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::Forward;

/// Odds of three to one are positive evidence (Kass and Raftery, Journal of the American Statistical Association 90 (1995) 773).
const POSITIVE: f64 = 1.1;

/// A piece of the study that is absent at values of its unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct Own {
    /// What the study calls it.
    pub name: String,
    /// The places of its unknowns among the parameters, with the values at which it is absent.
    pub absent: Vec<(usize, f64)>,
}

/// A piece of the study that is not needed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Needless {
    /// What the study calls it.
    pub name: String,
    /// The log of the probability of the data without it over that with it, both with what was found.
    pub log_odds: f64,
    /// The standard error of that.
    pub error: f64,
}

impl Needless {
    /// In a sentence.
    pub fn words(&self) -> String {
        format!(
            "With what was found the study's own `{}` is not needed: without it the data are more probable, by a factor \
             e^{:.1} (± {:.1} in the exponent).",
            self.name, self.log_odds, self.error
        )
    }
}

/// Those of the study's own pieces that are not needed beside what was found; none where nothing was.
pub fn needless(found: &Found<'_>, pieces: &[Own], stream: &Stream) -> Vec<Needless> {
    if found.chosen.is_empty() {
        return Vec::new();
    }
    let stream = stream.named("needless");
    let (whitener, means) = (&found.whitener, &found.means);
    let best = &found.last.fit;
    let with = weigh(&found.system, whitener, means, best, &stream.named("with"));
    let one = |piece: &Own| -> Option<Needless> {
        let kept: Vec<usize> = (0..found.system.dimension())
            .filter(|i| !piece.absent.iter().any(|(held, _)| held == i))
            .collect();
        let experiment = found.system.experiment;
        let parameters = kept.iter().filter_map(|&i| experiment.parameters.get(i));
        let parameters: Vec<Parameter> = parameters.cloned().collect();
        let forward = Held { forward: experiment.forward, held: &piece.absent };
        let wide = experiment.wide.map(|wide| Wide {
            forward: Box::new(Held { forward: &*wide.forward, held: &piece.absent }),
            inputs: wide.inputs.clone(),
            common: wide.common.clone(),
        });
        let region = experiment.region.as_ref();
        let region = region.map(|r| kept.iter().filter_map(|&i| r.get(i)).copied().collect());
        let smaller = Experiment {
            parameters: &parameters,
            forward: &forward,
            wide: wide.as_ref(),
            region,
            ..experiment.clone()
        };
        let system = System::new(&smaller, found.system.effects.clone());
        let start: Vec<f64> = kept.iter().map(|&i| best.at.point[i]).collect();
        let fit = fit(&system, whitener, means, &start);
        if !fit.log_density.is_finite() {
            return None;
        }
        let without = weigh(&system, whitener, means, &fit, &stream.named(&piece.name));
        let log_odds = without.log_evidence - with.log_evidence;
        let error = without.error.hypot(with.error);
        Some(Needless { name: piece.name.clone(), log_odds, error })
    };
    pieces.iter().filter_map(one).filter(|piece| piece.log_odds > POSITIVE).collect()
}

/// A forward map some of whose parameters are held.
struct Held<'a> {
    forward: &'a dyn Forward,
    /// In the order of the parameters.
    held: &'a [(usize, f64)],
}

impl Held<'_> {
    fn whole(&self, own: &[f64]) -> Vec<f64> {
        let mut whole = own.to_vec();
        self.held.iter().for_each(|&(i, value)| whole.insert(i, value));
        whole
    }

    /// The places of the free ones among all parameters.
    fn free(&self) -> Vec<usize> {
        let is_free = |i: &usize| !self.held.iter().any(|(held, _)| held == i);
        (0..self.forward.dimension()).filter(is_free).collect()
    }
}

impl Forward for Held<'_> {
    fn dimension(&self) -> usize {
        self.forward.dimension() - self.held.len()
    }

    fn outputs(&self) -> usize {
        self.forward.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        let rows = points.iter_rows().map(|own| self.whole(own));
        self.forward.mean(&Matrix::from_rows(self.forward.dimension(), rows))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.mean_and_jacobian(point).1
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        self.forward.mean_and_jacobian_by(&self.whole(point), &self.free())
    }

    fn mean_and_jacobian_by(&self, point: &[f64], parameters: &[usize]) -> (Vec<f64>, Matrix) {
        let free = self.free();
        let columns: Vec<usize> = parameters.iter().map(|&i| free[i]).collect();
        self.forward.mean_and_jacobian_by(&self.whole(point), &columns)
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}

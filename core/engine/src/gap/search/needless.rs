//! Terms and effects of the study that are not needed beside the effects that were found: the data are more probable
//! without them.
//!
//! A term that compensated for a missing effect is compatible with zero once that effect is present. The Bayes factor
//! compares the same explanation without and with the term, each after its own calibration under the same noise.

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna::plugin::forward::Wanted;
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

use super::{SearchResult, log_evidence};
use crate::gap::experiment::Experiment;
use crate::gap::experiment::wider::ExtendedMap;
use crate::gap::system::System;
use crate::gap::system::fit::fit;

/// The smallest log Bayes factor: 3 to 1 is positive evidence (Kass and Raftery, Journal of the American Statistical
/// Association 90 (1995) 773).
const POSITIVE: f64 = 1.1;

/// A piece of the study that is absent at values of its unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnPiece {
    /// The name in the study.
    pub name: String,
    /// The indices of its unknowns among the parameters, with the values at which it is absent.
    pub absent: Vec<(usize, f64)>,
}

/// A piece of the study that is not needed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Needless {
    /// The name in the study.
    pub name: String,
    /// The log Bayes factor of the model without it against the model with it, both with the effects that were found.
    pub log_odds: f64,
    /// The standard error of the log Bayes factor.
    pub error: f64,
}

impl Needless {
    /// The result in a sentence.
    pub fn words(&self) -> String {
        format!(
            "With what was found the study's own `{}` is not needed: without it the data are more probable, log Bayes factor \
             {:.1} ± {:.1}.",
            self.name, self.log_odds, self.error
        )
    }
}

/// The pieces of the study that are not needed beside the effects that were found; empty if no effect was found.
pub fn needless(found: &SearchResult<'_>, pieces: &[OwnPiece], stream: &Stream) -> Vec<Needless> {
    if found.chosen.is_empty() {
        return Vec::new();
    }
    let stream = stream.named("needless");
    let (whitener, means) = (&found.whitener, &found.means);
    let best = &found.last.fit;
    let with = log_evidence(&found.system, whitener, means, best, &stream.named("with"));
    let one = |piece: &OwnPiece| -> Option<Needless> {
        let kept: Vec<usize> = (0..found.system.dimension())
            .filter(|i| !piece.absent.iter().any(|(held, _)| held == i))
            .collect();
        let experiment = found.system.experiment;
        let parameters = kept.iter().filter_map(|&i| experiment.parameters.get(i));
        let parameters: Vec<Parameter> = parameters.cloned().collect();
        let forward = Held { forward: experiment.forward, held: &piece.absent };
        let wide = experiment.wide.map(|wide| ExtendedMap {
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
        let without = log_evidence(&system, whitener, means, &fit, &stream.named(&piece.name));
        let log_odds = without.value - with.value;
        let error = without.error.hypot(with.error);
        Some(Needless { name: piece.name.clone(), log_odds, error })
    };
    pieces.iter().filter_map(one).filter(|piece| piece.log_odds > POSITIVE).collect()
}

/// A forward map with some of its parameters held fixed.
struct Held<'a> {
    forward: &'a dyn Forward,
    /// Indices and values of the parameters held fixed, in the order of the parameters.
    held: &'a [(usize, f64)],
}

impl Held<'_> {
    fn whole(&self, own: &[f64]) -> Vec<f64> {
        let mut whole = own.to_vec();
        self.held.iter().for_each(|&(i, value)| whole.insert(i, value));
        whole
    }

    /// The indices of the free parameters among all.
    fn free(&self) -> Vec<usize> {
        let is_free = |i: &usize| !self.held.iter().any(|(held, _)| held == i);
        (0..self.forward.dimension()).filter(is_free).collect()
    }

    /// The points of the inner map, one a row.
    fn whole_rows(&self, points: &Matrix) -> Matrix {
        let rows = points.iter_rows().map(|own| self.whole(own));
        Matrix::from_rows(self.forward.dimension(), rows)
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
        self.forward.mean(&self.whole_rows(points))
    }

    fn mean_at(&self, needed: &[bool], points: &Matrix) -> Matrix {
        self.forward.mean_at(needed, &self.whole_rows(points))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.mean_and_jacobian(point).1
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        self.forward.mean_and_jacobian_by(&self.whole(point), Wanted::by(&self.free()))
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let free = self.free();
        let columns: Vec<usize> = wanted.parameters.iter().map(|&i| free[i]).collect();
        let wanted = Wanted { parameters: &columns, ..wanted };
        self.forward.mean_and_jacobian_by(&self.whole(point), wanted)
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}

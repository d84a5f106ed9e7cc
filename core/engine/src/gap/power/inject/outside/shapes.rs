//! Fixed shapes that no effect of the library has.

use std::f64::consts::{PI, TAU};

use lacuna::math::random::{below, uniform};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{Curves, Drawn};

/// A shape that no effect of the library has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnlistedShape {
    /// Time runs faster from the middle of the record on, on all curves of one condition.
    Stretch,
    /// Each curve has a part of its own reversed copy.
    Reversed,
    /// A swelling and fading oscillation whose frequency rises, on half of the curves.
    Chirp,
}

impl UnlistedShape {
    /// All shapes.
    pub const ALL: [Self; 3] = [Self::Stretch, Self::Reversed, Self::Chirp];

    /// The shape with random parameters.
    pub(super) fn drawn(self, curves: &Curves<'_>, rng: &mut impl Rng) -> Drawn {
        let condition = below(rng, curves.experiment.conditions.len());
        let (middle, turns) = (0.3 + 0.4 * uniform(rng), 2.0 + 4.0 * uniform(rng));
        let all = curves.experiment.curves.iter().enumerate();
        let acts = all
            .map(|(s, curve)| match self {
                Self::Stretch => curve.condition == condition,
                Self::Reversed => true,
                Self::Chirp => s % 2 == 0,
            })
            .collect();
        let form = match self {
            Self::Stretch => "time that runs faster from the middle on",
            Self::Reversed => "a part of the reversed curve",
            Self::Chirp => "an oscillation of rising frequency",
        };
        let form = form.to_owned();
        match self {
            Self::Stretch => Drawn::sum(form, acts, move |record| {
                let slope = record.slope().into_iter().zip(&record.at);
                slope.map(|(slope, at)| (at - middle).max(0.0) * slope).collect()
            }),
            Self::Reversed => {
                Drawn::sum(form, acts, |record| record.y.iter().rev().copied().collect())
            }
            Self::Chirp => Drawn::sum(form, acts, move |record| {
                let value = |at: &f64| (PI * at).sin().powi(2) * (TAU * turns * at * at).sin();
                record.at.iter().map(value).collect()
            }),
        }
    }
}

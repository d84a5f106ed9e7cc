//! Distributed physics: a change that acts on all sensors, with a strength or a delay that varies smoothly from one to the
//! next.

use std::f64::consts::PI;

use lacuna::math::random::{below, uniform};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{Curves, Drawn};

/// Physics that acts on all sensors and varies along them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distributed {
    /// An exponential loss whose rate varies.
    Damping,
    /// A gain that varies.
    Gain,
    /// A delay that varies.
    Delay,
    /// A weaker copy that comes later from sensor to sensor.
    Echo,
    /// A pulse that travels along the sensors.
    Pulse,
}

/// The course of a strength along the sensors.
#[derive(Debug, Clone, Copy)]
enum Profile {
    Rising,
    Falling,
    Hump,
}

impl Profile {
    fn random(rng: &mut impl Rng) -> Self {
        [Self::Rising, Self::Falling, Self::Hump][below(rng, 3)]
    }

    /// The strength at a place from 0 to 1; nowhere zero, so that the change acts on every sensor.
    fn at(self, place: f64) -> f64 {
        0.15 + 0.85
            * match self {
                Self::Rising => place,
                Self::Falling => 1.0 - place,
                Self::Hump => (PI * place).sin(),
            }
    }

    const fn words(self) -> &'static str {
        match self {
            Self::Rising => "rising along the sensors",
            Self::Falling => "falling along the sensors",
            Self::Hump => "strongest at the middle sensors",
        }
    }
}

impl Distributed {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Damping, Self::Gain, Self::Delay, Self::Echo, Self::Pulse];

    /// The physics with random parameters on all curves; `None` with fewer than three sensors.
    pub(super) fn drawn(self, curves: &Curves<'_>, rng: &mut impl Rng) -> Option<Drawn> {
        if curves.sensors() < 3 {
            return None;
        }
        let acts = vec![true; curves.records.len()];
        let profile = Profile::random(rng);
        let strength = move |place: f64| profile.at(place);
        let along = profile.words();
        Some(match self {
            Self::Damping => {
                Drawn::of(format!("a loss at a rate {along}"), acts, move |record, size| {
                    let rate = size * strength(record.place);
                    record.y.iter().zip(&record.at).map(|(y, t)| y * (-rate * t).exp()).collect()
                })
            }
            Self::Gain => Drawn::sum(format!("a gain {along}"), acts, move |record| {
                record.y.iter().map(|y| strength(record.place) * y).collect()
            }),
            Self::Delay => Drawn::of(format!("a delay {along}"), acts, move |record, size| {
                record.earlier(size * strength(record.place))
            }),
            Self::Echo => {
                let (first, further) = (0.05 + 0.15 * uniform(rng), 0.1 + 0.3 * uniform(rng));
                let form = format!("a copy whose delay is {along}");
                Drawn::sum(form, acts, move |record| {
                    let copy = record.earlier(first + further * strength(record.place));
                    copy.iter().map(|y| y - record.y[0]).collect()
                })
            }
            Self::Pulse => {
                let (first, crossing) = (0.1 + 0.3 * uniform(rng), 0.1 + 0.4 * uniform(rng));
                let width = 0.02 + 0.06 * uniform(rng);
                let form = "a pulse that travels along the sensors".to_owned();
                Drawn::sum(form, acts, move |record| {
                    let arrival = first + crossing * record.place;
                    let value = |t: &f64| (-0.5 * ((t - arrival) / width).powi(2)).exp();
                    record.at.iter().map(value).collect()
                })
            }
        })
    }
}

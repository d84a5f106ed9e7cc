//! A bump on one curve: a change of a place, not of a form.

use lacuna::math::random::{Stream, below, uniform};
use serde::{Deserialize, Serialize};

use crate::gap::experiment::Experiment;
use crate::gap::power::PowerSetting;
use crate::gap::test::Region;

/// A bump on one curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bump {
    /// The index of the curve.
    pub curve: usize,
    /// The indices of the first and the last of its measured values.
    pub window: (usize, usize),
}

/// Adds a half sine over a tenth to a third of one curve; its size is the root mean square over itself.
pub(super) fn add_bump(
    setting: &PowerSetting<'_>,
    ratio: f64,
    response: &mut [f64],
    stream: &Stream,
) -> Option<Bump> {
    let mut rng = stream.generator();
    let long: Vec<usize> = (0..setting.experiment.curves.len())
        .filter(|&s| setting.experiment.curves[s].measured.len() >= 20)
        .collect();
    if long.is_empty() {
        return None;
    }
    let curve = long[below(&mut rng, long.len())];
    let measured = &setting.experiment.curves[curve].measured;
    let share = 0.1 + 0.25 * uniform(&mut rng);
    let width = ((share * measured.len() as f64) as usize).max(4);
    let begin = below(&mut rng, measured.len() - width);
    let noise = setting.noise.sd(setting.experiment, &setting.fit.at.response);
    for (k, &i) in measured[begin..begin + width].iter().enumerate() {
        let phase = std::f64::consts::PI * (k as f64 + 0.5) / width as f64;
        response[i] += ratio * std::f64::consts::SQRT_2 * noise[i] * phase.sin();
    }
    Some(Bump { curve, window: (begin, begin + width - 1) })
}

impl Bump {
    /// The intersection over union of the bump with the regions, zero to one.
    pub fn overlap(&self, experiment: &Experiment<'_>, regions: &[Region]) -> f64 {
        let (mut found, mut both) = (0, 0);
        for (s, curve) in experiment.curves.iter().enumerate() {
            for k in 0..curve.measured.len() {
                let inside = |r: &Region| {
                    r.curves.contains(&s) && (r.span.0..=r.span.1).contains(&curve.at[k])
                };
                let is_found = regions.iter().any(inside);
                found += usize::from(is_found);
                let is_bump = s == self.curve && (self.window.0..=self.window.1).contains(&k);
                both += usize::from(is_found && is_bump);
            }
        }
        let bump = self.window.1 - self.window.0 + 1;
        both as f64 / (found + bump - both) as f64
    }
}

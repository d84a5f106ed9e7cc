//! Part of an experiment, with its noise.

use super::Noise;
use crate::gap::experiment::Experiment;

/// The experiment with only the values for which `keep(condition, replicate, output)` holds, and the noise of that
/// part.
pub fn part<'a>(
    experiment: &Experiment<'a>,
    noise: &Noise,
    keep: impl Fn(usize, usize, usize) -> bool,
) -> (Experiment<'a>, Noise) {
    let conditions = experiment.conditions.iter().enumerate();
    let replicates = conditions.map(|(c, condition)| {
        let kept = condition.replicates.iter().enumerate().map(|(r, replicate)| {
            let each = condition.outputs.clone().zip(replicate);
            each.map(|(i, y)| y.filter(|_| keep(c, r, i))).collect::<Vec<_>>()
        });
        kept.filter(|values| values.iter().any(Option::is_some)).collect()
    });
    let part = experiment.with_replicates(replicates.collect()).remeasured();
    let noise = noise.restricted(experiment, &part);
    (part, noise)
}

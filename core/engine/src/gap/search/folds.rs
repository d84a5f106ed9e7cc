//! The parts of an experiment that cross-validation leaves out in turn.

use super::cross_validate::LeftOut;
use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;

/// Blocks of the last axis under each condition.
const BLOCKS: usize = 4;

/// Blocks of a single record, of which each is predicted from those before it.
const FORWARD: usize = 6;

/// The number of blocks at the beginning of a single record that are not predicted.
const BEFORE: usize = 2;

/// True when a value is meant, by condition, replicate and output.
type Chosen = Box<dyn Fn(usize, usize, usize) -> bool + Send + Sync>;

/// A part that is left out.
pub(super) struct Fold {
    /// Values that are left out and predicted.
    pub left_out: Chosen,
    /// Values that are neither predicted nor used for the prediction: the neighbourhood of a block.
    pub hidden: Chosen,
    /// The condition, if a single replicate is left out.
    pub replicate: Option<usize>,
}

/// All parts of a kind; fewer than two if the data cannot spare any.
pub(super) fn folds(experiment: &Experiment<'_>, noise: &Noise, kind: LeftOut) -> Vec<Fold> {
    match kind {
        LeftOut::Condition => {
            let measured = (0..experiment.conditions.len())
                .filter(|&c| !experiment.conditions[c].replicates.is_empty());
            measured.map(|c| whole(Box::new(move |own, _, _| own == c), None)).collect()
        }
        LeftOut::Replicate => {
            let conditions = experiment.conditions.iter().map(|c| c.replicates.len()).enumerate();
            let each =
                conditions.filter(|(_, n)| *n > 1).flat_map(|(c, n)| (0..n).map(move |r| (c, r)));
            each.map(|(c, r)| whole(Box::new(move |own, s, _| (own, s) == (c, r)), Some(c)))
                .collect()
        }
        LeftOut::Sensor => {
            let of = |on: lacuna::plugin::effect::On| {
                let own = experiment.curves.iter().filter(|curve| place(curve) == on);
                let own = chosen(experiment, own.flat_map(|curve| curve.measured.iter().copied()));
                whole(Box::new(move |_, _, i| own[i]), None)
            };
            sensors(experiment).into_iter().map(of).collect()
        }
        LeftOut::Block => {
            (0..experiment.conditions.len()).flat_map(|c| blocks(experiment, noise, c)).collect()
        }
    }
}

fn whole(left_out: Chosen, replicate: Option<usize>) -> Fold {
    Fold { left_out, hidden: Box::new(|_, _, _| false), replicate }
}

fn chosen(experiment: &Experiment<'_>, outputs: impl Iterator<Item = usize>) -> Vec<bool> {
    let mut all = vec![false; experiment.outputs()];
    outputs.for_each(|i| all[i] = true);
    all
}

/// Blocks of a condition of equally many places each; none where noise goes together over whole blocks. A block of a
/// single record is predicted from what precedes it: both sides together show a missing curve to any smooth form.
fn blocks(experiment: &Experiment<'_>, noise: &Noise, c: usize) -> Vec<Fold> {
    let curves = experiment.conditions[c].curves.clone();
    let mut places: Vec<f64> = experiment.curves[curves.clone()]
        .iter()
        .flat_map(|curve| curve.at.iter().copied())
        .collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    // An exponential correlation, whose sum over both sides is twice its time, falls to a fiftieth over twice that sum.
    let together = noise.curves[curves.clone()].iter().map(|law| law.memory.inflation());
    let apart = (2.0 * together.fold(1.0, f64::max)).ceil() as usize;
    let is_single = experiment.conditions[c].replicates.len() < 2;
    let count = if is_single { FORWARD } else { BLOCKS };
    let length = places.len() / count;
    if length <= apart {
        return Vec::new();
    }
    let within = |from: f64, to: f64| {
        let own = experiment.curves[curves.clone()].iter().flat_map(|curve| {
            let places = curve.measured.iter().zip(&curve.at);
            places.filter(move |(_, at)| (from..=to).contains(*at)).map(|(&i, _)| i)
        });
        chosen(experiment, own)
    };
    let first = if is_single { BEFORE } else { 0 };
    (first..count)
        .map(|b| {
            let begin = b * places.len() / count;
            let end = (b + 1) * places.len() / count;
            let own = within(places[begin], places[end - 1]);
            let last = places.len() - 1;
            let high = if is_single { last } else { (end - 1 + apart).min(last) };
            let low = begin.saturating_sub(apart);
            let around = within(places[low], places[high]);
            let hidden: Vec<bool> =
                own.iter().zip(around).map(|(own, near)| near && !own).collect();
            Fold {
                left_out: Box::new(move |_, _, i| own[i]),
                hidden: Box::new(move |_, _, i| hidden[i]),
                replicate: None,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::gap::testing::SyntheticExperiment;
    use lacuna::math::random::Stream;

    /// The blocks of a single record are predicted from what precedes them; those of replicates from both sides.
    #[test]
    fn a_single_record_is_foretold() {
        let world = SyntheticExperiment::new(&["a"], &["B"], 60, 0.0, &["level"], |_, _, _, _| 1.0);
        for (replicates, forward) in [(1, true), (2, false)] {
            let experiment = world.experiment(&[0.0; 60], replicates, &Stream::root(1));
            let folds = folds(&experiment, &world.noise, LeftOut::Block);
            assert_eq!(folds.len(), 4);
            let mut predicted = 0;
            for fold in folds {
                let own: Vec<usize> = (0..60).filter(|&i| (fold.left_out)(0, 0, i)).collect();
                let used: Vec<usize> = (0..60)
                    .filter(|&i| !(fold.left_out)(0, 0, i) && !(fold.hidden)(0, 0, i))
                    .collect();
                predicted += own.len();
                let later = used.iter().filter(|&&i| i > own[0]).count();
                let earlier = used.len() - later;
                assert!(if forward { later == 0 && earlier >= 15 } else { used.len() >= 35 });
            }
            assert_eq!(predicted, if forward { 40 } else { 60 });
        }
    }
}

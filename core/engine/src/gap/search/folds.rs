//! The parts of an experiment that cross-validation leaves out in turn.

use super::cross_validate::LeftOut;
use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;

/// Blocks of the last axis under each condition.
const BLOCKS: usize = 4;

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

/// Blocks of a condition of equally many places each; none where noise goes together over whole blocks.
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
    let length = places.len() / BLOCKS;
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
    (0..BLOCKS)
        .map(|b| {
            let begin = b * places.len() / BLOCKS;
            let end = (b + 1) * places.len() / BLOCKS;
            let own = within(places[begin], places[end - 1]);
            let (low, high) =
                (begin.saturating_sub(apart), (end - 1 + apart).min(places.len() - 1));
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

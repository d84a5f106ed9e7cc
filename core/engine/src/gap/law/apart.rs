//! A part of the data that is used neither to choose nor to fit a law: a condition, or blocks of the curves under all
//! conditions.

use lacuna::math::random::{Stream, below};
use lacuna_linalg::Matrix;

use super::find::Described;
use crate::gap::experiment::Experiment;
use crate::gap::experiment::blocks::held_out_blocks;
use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::noise::Noise;
use crate::gap::prove::{freedoms, prove};
use crate::gap::result::law::LawProof;

/// The smallest number of conditions of which one is held out.
const CONDITIONS: usize = 3;

/// The share of the values that blocks hold out.
const SHARE: f64 = 0.25;

/// An experiment in two parts.
pub struct Apart<'a> {
    /// The data from which a law is chosen.
    pub training: Experiment<'a>,
    /// The data that it has to predict.
    pub held_out: Experiment<'a>,
    /// The kind of the data that are held out.
    pub kind: HeldOutKind,
    /// The names of its parts.
    pub names: Vec<String>,
}

impl Apart<'_> {
    /// The proof of a law on the held-out part; `whole` are all data, from which the noise of what is held out follows.
    pub fn proof(&self, whole: &Experiment<'_>, described: &Described) -> Option<LawProof> {
        compared(&self.held_out, whole, described, (self.kind, &self.names))
    }
}

/// The proof of a law on held-out data, from the noise around it in all data.
pub fn compared(
    held_out: &Experiment<'_>,
    whole: &Experiment<'_>,
    described: &Described,
    (kind, names): (HeldOutKind, &[String]),
) -> Option<LawProof> {
    let noise = Noise::of(whole, &described.around, None).restricted(whole, held_out);
    let freedoms = freedoms(whole);
    let [before, force, after] = &described.responses;
    let proof = prove(held_out, &noise, &freedoms, before, after)?;
    let against_force = prove(held_out, &noise, &freedoms, force, after)?.log_score;
    Some(LawProof { kind, names: names.to_vec(), against_force, proof })
}

/// Holds out one of at least three conditions, or else blocks of the last axis; `None` if the curves are too short.
pub fn apart<'a>(experiment: &Experiment<'a>, stream: &Stream) -> Option<Apart<'a>> {
    let measured: Vec<usize> = (0..experiment.conditions.len())
        .filter(|&c| !experiment.conditions[c].replicates.is_empty())
        .collect();
    let mut hidden = vec![false; experiment.outputs()];
    let (kind, names) = if measured.len() >= CONDITIONS {
        let c = measured[below(&mut stream.generator(), measured.len())];
        let condition = &experiment.conditions[c];
        condition.outputs.clone().for_each(|i| hidden[i] = true);
        (HeldOutKind::Scenarios, vec![condition.scenario.clone().unwrap_or_default()])
    } else {
        (HeldOutKind::Blocks, blocks(experiment, &mut hidden, stream))
    };
    if !hidden.iter().any(|hidden| *hidden) {
        return None;
    }
    let part = |wanted: bool| {
        let replicates = experiment.conditions.iter().map(|condition| {
            let kept = condition.replicates.iter().map(|values| {
                let each = condition.outputs.clone().zip(values);
                each.map(|(i, y)| y.filter(|_| hidden[i] == wanted)).collect::<Vec<_>>()
            });
            kept.filter(|values| values.iter().any(Option::is_some)).collect()
        });
        experiment.with_replicates(replicates.collect()).remeasured()
    };
    let (training, mut held_out) = (part(false), part(true));
    held_out.forms = Matrix::default();
    Some(Apart { training, held_out, kind, names })
}

/// Hides blocks of each curve, the same in all replicates, and names them.
fn blocks(experiment: &Experiment<'_>, hidden: &mut [bool], stream: &Stream) -> Vec<String> {
    let mut names = Vec::new();
    for condition in &experiment.conditions {
        let Some(first) = experiment.curves.get(condition.curves.start) else { continue };
        // Curves of a condition share their times, so that its sensors lack the same ones.
        let stream = stream.at(condition.curves.start as u64);
        for block in held_out_blocks(first.at.len(), SHARE, &stream) {
            let (from, to) = (first.at[block.start], first.at[block.end - 1]);
            let scenario = condition.scenario.as_ref().map(|s| format!("{s} ")).unwrap_or_default();
            names.push(format!("{scenario}from {from} to {to}"));
            for curve in &experiment.curves[condition.curves.clone()] {
                let own = curve.measured.iter().zip(&curve.at);
                own.filter(|(_, at)| (from..=to).contains(*at))
                    .for_each(|(&i, _)| hidden[i] = true);
            }
        }
    }
    names
}

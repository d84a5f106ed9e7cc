//! Data by curve: the values of one replicate under one scenario, which may depend on each other.

use std::ops::Range;

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Layout, Measurements, Observations};
use lacuna::plugin::{Hyperparameter, Likelihood};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::calibrate::Law;
use super::pieces::Pieces;

/// A curve.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Curve {
    /// Name of the replicate, with the scenario or the group if these distinguish curves.
    pub name: String,
    /// Index of the block of scenarios.
    block: usize,
    /// Index of the replicate in the block.
    replicate: usize,
    /// Indices of the outputs in the block that the curve has values for.
    outputs: Vec<usize>,
}

/// Curves of all data, in the order of the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Curves {
    /// All curves; empty if there are fewer than two.
    pub all: Vec<Curve>,
    /// Index of the curve of each datum: by block, by replicate, by output without the missing ones.
    pub of: Vec<usize>,
}

/// Name and output indices of each part of a block.
type Parts = Vec<(String, Vec<usize>)>;

impl Curves {
    /// One curve per replicate and scenario; if that is a single one, one per replicate and group (such as a sensor).
    pub fn of(data: &Observations) -> Self {
        let whole = Self::by(data, scenarios);
        if whole.all.len() > 1 {
            return whole;
        }
        let parted = Self::by(data, |layout| {
            layout.groups().into_iter().map(|group| (group.name, group.indices)).collect()
        });
        if parted.all.len() > 1 { parted } else { Self { all: Vec::new(), of: Vec::new() } }
    }

    fn by(data: &Observations, parts: impl Fn(&Layout) -> Parts) -> Self {
        let (mut all, mut of) = (Vec::new(), Vec::new());
        for (block, measured) in data.blocks.iter().enumerate() {
            let parts = parts(&measured.layout);
            let mut part_of = vec![0; measured.layout.len()];
            for (p, (_, outputs)) in parts.iter().enumerate() {
                for &i in outputs {
                    part_of[i] = p;
                }
            }
            for (replicate, values) in measured.replicates.iter().enumerate() {
                let is_measured = |i: usize| values.values[i].is_some();
                let first = all.len();
                let mut place = vec![usize::MAX; parts.len()];
                for (p, (part, outputs)) in parts.iter().enumerate() {
                    let outputs: Vec<usize> =
                        outputs.iter().copied().filter(|&i| is_measured(i)).collect();
                    if outputs.is_empty() {
                        continue;
                    }
                    place[p] = all.len();
                    let name = [part.as_str(), values.name.as_str()].join(" ").trim().to_owned();
                    all.push(Curve { name, block, replicate, outputs });
                }
                if all.len() > first {
                    let measured = (0..part_of.len()).filter(|&i| is_measured(i));
                    of.extend(measured.map(|i| place[part_of[i]]));
                }
            }
        }
        Self { all, of }
    }
}

/// For each datum, in their order, whether it is the first of its replicate and scenario.
pub fn beginnings(data: &Observations) -> impl Iterator<Item = bool> {
    data.blocks.iter().flat_map(|block| {
        let scenarios = block.layout.axes.first().filter(|axis| axis.name == SCENARIO);
        let length = block.layout.len() / scenarios.map_or(1, |axis| axis.len().max(1));
        block.replicates.iter().flat_map(move |replicate| {
            let mut last = None;
            let measured =
                (0..replicate.values.len()).filter(move |&i| replicate.values[i].is_some());
            measured.map(move |i| last.replace(i / length) != Some(i / length))
        })
    })
}

/// Output indices of each scenario of a block.
fn scenarios(layout: &Layout) -> Parts {
    match layout.axes.first().filter(|axis| axis.name == SCENARIO) {
        Some(axis) => {
            let length = layout.len() / axis.len().max(1);
            (0..axis.len())
                .map(|s| (axis.text(s), (s * length..(s + 1) * length).collect()))
                .collect()
        }
        None => vec![(String::new(), (0..layout.len()).collect())],
    }
}

/// Number of draws at which a likelihood is computed together.
const TOGETHER: usize = 32;

/// Number of curves that are left out together.
const CURVES_TOGETHER: usize = 64;

/// Log density of each curve given all other data and the parameters, `draws x curves`: the log-likelihood of all data
/// less that of the data without the curve. `None` if the discrepancy has no such form.
///
/// `hyper` holds the hyperparameters of the likelihood at each draw, `names` their names.
pub fn left_out(
    curves: &[Curve],
    law: &Law<'_>,
    data: &Observations,
    ranges: &[Range<usize>],
    responses: &[Vec<f64>],
    (names, hyper): (&[Hyperparameter], &Matrix),
    pieces: &mut Pieces<'_>,
) -> Result<Option<Matrix>, Stop> {
    let mut densities = Matrix::zeros(responses.len(), curves.len());
    let values = |block: usize, likelihood: &dyn Likelihood| -> Vec<f64> {
        let place = |own: &Hyperparameter| names.iter().position(|other| other.name == own.name);
        let places: Vec<Option<usize>> = likelihood.hyperparameters().iter().map(place).collect();
        let some = |(chunk, responses): (usize, &[Vec<f64>])| {
            let range = ranges[block].clone();
            let rows = responses.iter().map(|response| &response[range.clone()]);
            let own = Matrix::from_fn(responses.len(), places.len(), |i, k| {
                places[k].map_or(f64::NAN, |place| hyper[(chunk * TOGETHER + i, place)])
            });
            likelihood.log_likelihoods(&Matrix::from_rows(range.len(), rows), &own)
        };
        responses.par_chunks(TOGETHER).enumerate().flat_map_iter(some).collect()
    };
    for (block, measured) in data.blocks.iter().enumerate() {
        let Some(all) = law.part(block, measured)? else { return Ok(None) };
        let whole = values(block, &*all);
        let own: Vec<usize> = (0..curves.len()).filter(|&c| curves[c].block == block).collect();
        // A likelihood that is made anew factors the covariance of its data, which takes most of the time.
        let of_the_rest = |&c: &usize| -> Result<Option<Vec<f64>>, Stop> {
            let rest = without(measured, &curves[c]);
            // Without other data the conditional density is that of the curve itself.
            if rest.count() == 0 {
                return Ok(Some(vec![0.0; whole.len()]));
            }
            let part = match all.of_part(&rest) {
                None => law.part(block, &rest)?,
                known => known,
            };
            Ok(part.map(|part| values(block, &*part)))
        };
        pieces.announce(own.len().div_ceil(CURVES_TOGETHER));
        for own in own.chunks(CURVES_TOGETHER) {
            // Without densities of parts of the data the piece is empty.
            let rests = pieces.next(|| {
                let rests: Option<Vec<Vec<f64>>> =
                    own.par_iter().map(of_the_rest).collect::<Result<_, Stop>>()?;
                Ok(rests.unwrap_or_default().concat())
            })?;
            if rests.is_empty() {
                return Ok(None);
            }
            for (&c, rest) in own.iter().zip(rests.chunks_exact(whole.len())) {
                for (draw, (all, rest)) in whole.iter().zip(rest).enumerate() {
                    densities[(draw, c)] = all - rest;
                }
            }
        }
    }
    Ok(Some(densities))
}

/// The data without a curve; replicates without any value are dropped.
fn without(data: &Measurements, curve: &Curve) -> Measurements {
    let mut rest = data.clone();
    let values = &mut rest.replicates[curve.replicate].values;
    curve.outputs.iter().for_each(|&i| values[i] = None);
    if values.iter().all(Option::is_none) {
        rest.replicates.remove(curve.replicate);
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Replicate, Unit};

    fn block(scenarios: &[&str], sensors: &[&str], replicates: usize) -> Measurements {
        let axes = vec![
            Axis::labels(SCENARIO, scenarios.to_vec()),
            Axis::labels("sensor", sensors.to_vec()),
        ];
        let axes: Vec<Axis> = axes.into_iter().filter(|axis| !axis.is_empty()).collect();
        let layout = Layout { name: "y".into(), unit: Unit::dimensionless(), axes };
        let value = |r: usize, i: usize| Some((10 * r + i) as f64);
        let replicate = |r: usize| {
            Replicate::new(format!("p{r}"), (0..layout.len()).map(|i| value(r, i)).collect())
        };
        let replicates = (0..replicates).map(replicate).collect();
        Measurements::new(layout, replicates)
    }

    fn names(curves: &Curves) -> Vec<&str> {
        curves.all.iter().map(|curve| curve.name.as_str()).collect()
    }

    #[test]
    fn a_curve_is_a_replicate_of_a_scenario() {
        let mut first = block(&["hot", "cold"], &["B", "C"], 2);
        // Replicate p0 has no value in the cold scenario, and one missing value in the hot one.
        first.replicates[0].values[1..].fill(None);
        let data = Observations { blocks: vec![first, block(&["wet"], &["B"], 1)] };
        let curves = Curves::of(&data);
        assert_eq!(names(&curves), ["hot p0", "hot p1", "cold p1", "wet p0"]);
        assert_eq!(curves.of, [0, 1, 1, 2, 2, 3]);
        assert_eq!(curves.of.len(), data.count());
        let firsts: Vec<bool> = beginnings(&data).collect();
        assert_eq!(firsts, [true, true, false, true, false, true]);
    }

    #[test]
    fn a_single_replicate_is_parted_by_its_groups() {
        let curves = Curves::of(&block(&[], &["B", "C", "G"], 1).into());
        assert_eq!(
            (names(&curves), &curves.of[..]),
            (vec!["B p0", "C p0", "G p0"], &[0, 1, 2][..])
        );
        let single = Curves::of(&block(&[], &["B"], 1).into());
        assert!(single.all.is_empty() && single.of.is_empty());
    }

    #[test]
    fn a_replicate_without_values_is_gone() {
        let data = block(&[], &["B", "C"], 3);
        let curves = Curves::of(&data.clone().into());
        let rest = without(&data, &curves.all[1]);
        let names: Vec<&str> = rest.replicates.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(names, ["p0", "p2"]);
    }
}

//! Chains that are still sampled: R-hat and effective sample sizes of the draws so far, and their traces.

use std::path::Path;

use lacuna::data::{Draws, Unit};
use lacuna::diagnose::{Criteria, chains};
use lacuna::math::moments;
use lacuna_run::seen::SeenStage;
use serde::Serialize;

use crate::page::chart::Trace;
use crate::page::scale::ShownUnit;
use crate::posterior::CoordinateScale;
use crate::stage::calibrate::{Outline, OutlinedCoordinate};
use crate::stage::sampling::look::{Look, look};

/// Largest number of values of draws that are read; of more, every other step or fewer are read.
const MOST_VALUES: usize = 1 << 20;
/// Smallest number of steps after the burn-in that are diagnosed.
const FEWEST_STEPS: usize = 8;
/// Largest numbers of coordinates and of chains that are drawn, and approximate number of points of all traces.
const MOST_ROWS: usize = 12;
const MOST_CHAINS: usize = 24;
const MOST_POINTS: usize = 16_000;
/// Approximate number of draws of a density.
const MOST_DRAWS: usize = 20_000;

/// Chains of a calibration up to their last checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sampling {
    /// Folder of the stage.
    pub folder: String,
    /// Number of chains.
    pub chains: usize,
    /// Number of steps so far.
    pub steps: usize,
    /// Number of steps after which the run ends, or decides whether to go on.
    pub planned: usize,
    /// Number of initial steps that are left out if the run ends now.
    pub burn_in: usize,
    /// Number of evaluations of the log density.
    pub evaluations: u64,
    /// True if the steps are draws; other methods make their draws at the end, and have no R-hat before.
    pub steps_are_draws: bool,
    /// Interval between the steps that are diagnosed. If it is above 1, the effective sample sizes are those of these steps
    /// alone, and those of all steps are larger.
    pub every: usize,
    /// Thresholds that the draws must meet.
    pub criteria: Criteria,
    /// True if all coordinates meet the thresholds of R-hat and effective sample size.
    pub meets: bool,
    /// Coordinates, parameters first.
    pub coordinates: Vec<RunningCoordinate>,
    /// Traces of the first coordinates.
    #[serde(skip)]
    pub traces: Vec<Trace>,
}

/// Draws of one coordinate so far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunningCoordinate {
    /// Name of the unknown.
    pub name: String,
    /// Unit of the unknown.
    pub unit: Unit,
    /// Scale of the coordinate. Figures are those of the value of the unknown, but for a member of a population, where they
    /// are those of its place in the population.
    pub scale: CoordinateScale,
    /// Mean of the draws; NaN (`null` in JSON) without enough draws, as all further figures.
    pub mean: f64,
    /// Standard deviation of the draws.
    pub sd: f64,
    /// Rank-normalised split R-hat.
    pub r_hat: f64,
    /// Effective sample size of the bulk.
    pub ess_bulk: f64,
    /// Effective sample size of the tails.
    pub ess_tail: f64,
}

impl Sampling {
    /// Reads the chains of the calibration that began last, an unfinished one if there is one; `None` without a checkpoint.
    pub(super) fn read(root: &Path, stages: &[SeenStage]) -> Option<Self> {
        let newest = stages.iter().max_by_key(|stage| {
            let has = Outline::read(&root.join(&stage.folder)).is_some();
            (has, stage.record.is_none(), stage.begun)
        })?;
        let folder = root.join(&newest.folder);
        let outline = Outline::read(&folder)?;
        let found = look(&folder, MOST_VALUES)?;
        Self::of(&newest.folder, &outline, found)
    }

    /// Diagnosis of draws; `None` if they are not those of the outline.
    fn of(folder: &str, outline: &Outline, found: Look) -> Option<Self> {
        let Look { steps, planned, every, mut draws, evaluations } = found;
        if draws.dimension() != outline.coordinates.len() {
            return None;
        }
        natural(outline, &mut draws);
        let plan = outline.plan;
        let share = (outline.burn_in * steps as f64).floor() as usize;
        let burn_in = share.max(plan.warm_up).min(steps);
        let kept = draws.from_step(burn_in.div_ceil(every));
        let criteria = if plan.ensemble { Criteria::ENSEMBLE } else { Criteria::CHAINS };
        let one = |(j, about): (usize, &OutlinedCoordinate)| {
            RunningCoordinate::of(
                about,
                outline.steps_are_draws,
                &kept.coordinate(j).collect::<Vec<_>>(),
            )
        };
        let coordinates: Vec<RunningCoordinate> =
            outline.coordinates.iter().enumerate().map(one).collect();
        Some(Self {
            folder: folder.to_owned(),
            chains: draws.chains,
            steps,
            planned: if planned == 0 { plan.steps } else { planned },
            burn_in,
            evaluations,
            steps_are_draws: outline.steps_are_draws,
            every,
            criteria,
            meets: coordinates.iter().all(|c| c.meets(&criteria)),
            traces: traces(outline, &draws, &kept, (burn_in, every), &coordinates),
            coordinates,
        })
    }
}

/// Replaces logarithms by the values.
fn natural(outline: &Outline, draws: &mut Draws) {
    let d = draws.dimension();
    for point in draws.values.chunks_exact_mut(d.max(1)) {
        for (x, about) in point.iter_mut().zip(&outline.coordinates) {
            if about.scale == CoordinateScale::Logarithmic {
                *x = x.exp();
            }
        }
    }
}

impl RunningCoordinate {
    fn of(about: &OutlinedCoordinate, are_draws: bool, values: &[Vec<f64>]) -> Self {
        let enough = are_draws && values.first().is_some_and(|chain| chain.len() >= FEWEST_STEPS);
        let figure = |of: &dyn Fn() -> f64| if enough { of() } else { f64::NAN };
        let pooled = if enough { values.concat() } else { Vec::new() };
        Self {
            name: about.name.clone(),
            unit: unit(about),
            scale: about.scale,
            mean: figure(&|| moments::mean(&pooled)),
            sd: figure(&|| moments::variance(&pooled).sqrt()),
            r_hat: figure(&|| chains::r_hat(values)),
            ess_bulk: figure(&|| chains::ess_bulk(values)),
            ess_tail: figure(&|| chains::ess_tail(values)),
        }
    }

    /// True if R-hat and effective sample sizes are known and meet the thresholds.
    fn meets(&self, criteria: &Criteria) -> bool {
        self.r_hat <= criteria.r_hat
            && self.ess_bulk >= criteria.ess
            && self.ess_tail >= criteria.ess
    }
}

/// Unit of the figures of a coordinate.
fn unit(about: &OutlinedCoordinate) -> Unit {
    match about.scale {
        CoordinateScale::OfPopulation => Unit::dimensionless(),
        _ => about.unit.clone(),
    }
}

fn traces(
    outline: &Outline,
    draws: &Draws,
    kept: &Draws,
    (burn_in, every): (usize, usize),
    figures: &[RunningCoordinate],
) -> Vec<Trace> {
    let spaced = |count: usize, most: usize| (0..count).step_by(count.div_ceil(most).max(1));
    let chains: Vec<usize> = spaced(draws.chains, MOST_CHAINS).collect();
    let rows = outline.coordinates.len().min(MOST_ROWS);
    let most = (MOST_POINTS / (rows * chains.len()).max(1)).max(2);
    let steps: Vec<usize> = spaced(draws.steps, most).collect();
    let trace = |(j, about): (usize, &OutlinedCoordinate)| {
        let pooled = kept.pooled(j);
        let last = draws.steps.checked_sub(1);
        let ends =
            last.into_iter().flat_map(|s| (0..draws.chains).map(move |c| draws.point(c, s)[j]));
        let shown = ShownUnit::for_values(&unit(about), ends.filter(|x| x.is_finite()));
        let value = |c: usize, s: usize| shown.show(draws.point(c, s)[j]);
        let name = match about.scale {
            CoordinateScale::OfPopulation => format!("{}, place in its population", about.name),
            _ => about.name.clone(),
        };
        Trace {
            title: name.clone(),
            label: shown.label(&name),
            chains: chains.iter().map(|&c| steps.iter().map(|&s| value(c, s)).collect()).collect(),
            numbers: chains.clone(),
            stranded: vec![false; chains.len()],
            steps: steps.iter().map(|s| s * every).collect(),
            burn_in,
            kept: spaced(pooled.len(), MOST_DRAWS).map(|i| shown.show(pooled[i])).collect(),
            effective: figures[j].ess_bulk,
            marks: Vec::new(),
        }
    };
    outline.coordinates.iter().enumerate().take(MOST_ROWS).map(trace).collect()
}

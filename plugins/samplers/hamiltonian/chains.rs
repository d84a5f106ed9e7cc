//! Independent chains, each with a step size of its own and all with a common metric.

use lacuna::math::random::Stream;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Fact, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use rand::rngs::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::curvature;
use super::leapfrog::{Flow, Point};
use super::metric::{Metric, Shape, Spread};
use super::pace::Pace;
use super::told::Last;
use super::windows::Windows;

/// Options shared by the samplers that use gradients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings {
    pub chains: usize,
    pub steps: usize,
    pub warm_up: usize,
    pub target_acceptance: f64,
    pub metric: Option<Shape>,
}

/// Minimum number of warm-up steps needed to tune a step size.
const SHORTEST_WARM_UP: usize = 20;

/// Largest number of unknowns for which the metric is dense by default.
const MOST_DENSE: usize = 20;

impl Settings {
    pub fn check(&self, complaints: &mut Complaints<'_>) {
        if self.chains == 0 {
            complaints.at("chains").say("no chains").expected("at least 1").found(0);
        }
        if self.warm_up < SHORTEST_WARM_UP {
            complaints
                .at("warm_up")
                .say("too few steps to learn the step size")
                .expected(format!("at least {SHORTEST_WARM_UP}"))
                .found(self.warm_up);
        }
        if self.steps <= self.warm_up {
            complaints
                .at("steps")
                .say("all steps are warm-up")
                .expected(format!("more than `warm_up`, which is {}", self.warm_up))
                .found(self.steps);
        }
        if !(0.1..1.0).contains(&self.target_acceptance) {
            complaints
                .at("target_acceptance")
                .say("no step size has this acceptance")
                .expected("a number from 0.1 to below 1")
                .found(self.target_acceptance);
        }
    }

    pub fn plan(&self) -> Plan {
        let &Self { chains, steps, warm_up, .. } = self;
        Plan { chains, steps, warm_up, ensemble: false }
    }

    pub fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("chains", self.chains),
            Fact::new("steps", self.steps),
            Fact::new("steps of the warm-up", self.warm_up),
            Fact::new("target acceptance", self.target_acceptance),
        ]
    }

    fn shape(&self, dimension: usize) -> Shape {
        let default = if dimension <= MOST_DENSE { Shape::Dense } else { Shape::Diagonal };
        self.metric.unwrap_or(default)
    }
}

/// Outcome of one step of one chain.
pub(crate) struct Transition {
    /// Point at which the step ends.
    pub point: Point,
    /// True if that point differs from the start.
    pub moved: bool,
    /// Acceptance statistic from which the step size is tuned.
    pub acceptance: f64,
    /// Number of gradients computed.
    pub gradients: u64,
    /// True if the energy error exceeded [`LARGEST_ERROR`].
    pub divergent: bool,
    /// True if the trajectory reached the maximum tree depth.
    pub saturated: bool,
    /// Hamiltonian at the end of the step: kinetic energy minus log density in the free coordinates, with the
    /// momentum there.
    pub energy: f64,
    /// Depth of the tree, i.e. number of doublings of the trajectory; `None` for trajectories of fixed length.
    pub depth: Option<u32>,
}

/// Memory of the sampler between steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Memory {
    /// Number of steps done.
    step: usize,
    metric: Metric,
    chains: Vec<Chain>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Chain {
    point: Point,
    /// Step size; `None` until it has been sought for the present metric.
    pace: Option<Pace>,
    /// Moments of the draws of the present window.
    spread: Option<Spread>,
    /// Number of divergent trajectories after the warm-up.
    divergences: u64,
    /// Number of trajectories after the warm-up that reached the maximum tree depth.
    saturated: u64,
    /// Statistics of the last trajectory.
    #[serde(default)]
    last: Option<Last>,
}

impl Memory {
    fn take(state: &mut State) -> Result<Self, Stop> {
        serde_json::from_value(state.memory.take()).map_err(foreign)
    }

    fn keep(&self, state: &mut State) -> Result<(), Stop> {
        state.memory = serde_json::to_value(self).map_err(foreign)?;
        Ok(())
    }
}

pub(crate) fn foreign(error: serde_json::Error) -> Stop {
    Stop::new(format!("the saved state is not one of this sampler: {error}"))
        .help("remove the run's `5-calibrate` folder and start the calibration again")
}

/// Checks number, dimension and finiteness of the starting points, one row per chain.
pub(crate) fn check_start(chains: usize, target: &dyn Target, points: &Matrix) -> Result<(), Stop> {
    let (rows, columns, dimension) = (points.rows(), points.columns(), target.dimension());
    if dimension == 0 {
        return Err(Stop::new("there is nothing to sample: no parameter is unknown"));
    }
    if (rows, columns) != (chains, dimension) {
        return Err(Stop::new(format!(
            "expected a starting point of {dimension} coordinates for each of {chains} chains, \
             found {rows} points of {columns}"
        )));
    }
    if points.as_slice().iter().any(|x| !x.is_finite()) {
        return Err(Stop::new("a starting point of the chains is not finite"));
    }
    Ok(())
}

/// Fails unless the density and its gradient exist at each starting point.
pub(crate) fn check_support(log_density: &[f64], points: &[Point]) -> Result<(), Stop> {
    let bad = |(_, (density, point)): &(usize, (&f64, &Point))| {
        !density.is_finite() || !point.value.is_finite()
    };
    let outside: Vec<String> = log_density
        .iter()
        .zip(points)
        .enumerate()
        .filter(bad)
        .map(|(chain, _)| (chain + 1).to_string())
        .collect();
    if outside.is_empty() {
        return Ok(());
    }
    Err(Stop::new(format!(
        "{} of {} chains start where the posterior density is zero or has no slope: number {}",
        outside.len(),
        log_density.len(),
        outside.join(", ")
    )))
}

/// Returns the state before the first step; the initial metric is that of the curvature at the starting points.
pub(crate) fn start(
    settings: &Settings,
    target: &dyn Target,
    points: Matrix,
) -> Result<State, Stop> {
    check_start(settings.chains, target, &points)?;
    let free = Unconstrained::new(target);
    let log_density = target.log_density(&points);
    let starts: Vec<Point> = points.iter_rows().map(|x| Point::at(&free, free.free(x))).collect();
    check_support(&log_density, &starts)?;
    let places: Vec<&[f64]> = starts.iter().map(|p| &p.place[..]).collect();
    let curvature = curvature::covariance(&free, &places);
    let metric =
        Metric::of(settings.shape(target.dimension()), &curvature.covariance).ok_or_else(|| {
            Stop::new("the curvature at the starting points gives no scale of the posterior")
        })?;
    let chain =
        |point| Chain { point, pace: None, spread: None, divergences: 0, saturated: 0, last: None };
    let memory = Memory { step: 0, metric, chains: starts.into_iter().map(chain).collect() };
    let count = points.rows();
    let mut state = State {
        points,
        log_density,
        accepted: vec![false; count],
        evaluations: 2 * count as u64 + curvature.gradients,
        memory: serde_json::Value::Null,
    };
    memory.keep(&mut state)?;
    Ok(state)
}

/// Advances all chains by one step in parallel, each with a random stream of its own.
pub(crate) fn advance<T>(
    settings: &Settings,
    target: &dyn Target,
    state: &mut State,
    stream: &Stream,
    transition: T,
) -> Result<(), Stop>
where
    T: Fn(&Flow<'_>, &Point, f64, &mut ChaCha8Rng) -> Transition + Sync,
{
    let mut memory = Memory::take(state)?;
    let free = Unconstrained::new(target);
    let flow = Flow { target: &free, metric: &memory.metric };
    let (step, windows) = (memory.step, Windows::new(settings.warm_up));
    let shape = settings.shape(target.dimension());
    let moves: Vec<(bool, u64)> = memory
        .chains
        .par_iter_mut()
        .enumerate()
        .map(|(index, chain)| {
            let mut rng = stream.at(index as u64).generator();
            let mut gradients = 0;
            let pace = chain.pace.get_or_insert_with(|| {
                let (pace, spent) =
                    Pace::find(&flow, &chain.point, settings.target_acceptance, &mut rng);
                gradients = spent;
                pace
            });
            let done = transition(&flow, &chain.point, pace.step, &mut rng);
            chain.last = Some(Last::of(&done, pace.step));
            if step < settings.warm_up {
                pace.learn(done.acceptance, settings.target_acceptance);
            } else {
                chain.divergences += u64::from(done.divergent);
                chain.saturated += u64::from(done.saturated);
            }
            if step + 1 == settings.warm_up {
                pace.settle();
            }
            chain.point = done.point;
            if windows.measure(step) {
                let dimension = chain.point.place.len();
                let spread = chain.spread.get_or_insert_with(|| Spread::new(shape, dimension));
                spread.add(&chain.point.place);
            }
            (done.moved, gradients + done.gradients)
        })
        .collect();
    if windows.end(step) {
        let spreads: Vec<Spread> =
            memory.chains.iter_mut().filter_map(|chain| chain.spread.take()).collect();
        memory.metric.learn(shape, &spreads);
        if windows.seek(step) {
            for chain in &mut memory.chains {
                chain.pace = None;
            }
        }
    }
    memory.step += 1;
    for (index, (chain, (moved, gradients))) in memory.chains.iter().zip(moves).enumerate() {
        if moved {
            state.points.row_mut(index).copy_from_slice(&free.bounded(&chain.point.place));
        }
        state.accepted[index] = moved;
        state.evaluations += gradients;
    }
    // The log density is evaluated at the very points that are stored, because the transform back from the free
    // coordinates rounds them.
    state.log_density = target.log_density(&state.points);
    state.evaluations += state.points.rows() as u64;
    memory.keep(state)
}

/// Up to this number of divergent trajectories, or up to this fraction of all, divergences are only noted: single
/// ones also happen in valid runs.
const FEW_DIVERGENCES: u64 = 3;
const SMALL_SHARE: f64 = 1e-3;

/// Numbers of trajectories after the warm-up.
struct Tally {
    all: usize,
    divergent: u64,
    saturated: u64,
}

impl Tally {
    fn of(settings: &Settings, state: &State) -> Option<Self> {
        let memory = serde_json::from_value::<Memory>(state.memory.clone()).ok()?;
        let sum = |count: fn(&Chain) -> u64| memory.chains.iter().map(count).sum::<u64>();
        Some(Self {
            all: memory.step.saturating_sub(settings.warm_up) * memory.chains.len(),
            divergent: sum(|c| c.divergences),
            saturated: sum(|c| c.saturated),
        })
    }

    fn diverges(&self) -> bool {
        self.divergent > FEW_DIVERGENCES && self.divergent as f64 > SMALL_SHARE * self.all as f64
    }

    fn divergences(&self) -> String {
        let share = 100.0 * self.divergent as f64 / self.all.max(1) as f64;
        format!(
            "{} of {} trajectories after the warm-up ({share:.2} %) diverged",
            self.divergent, self.all
        )
    }
}

/// Returns the reasons not to trust the draws: too many divergent or truncated trajectories.
pub(crate) fn doubts(settings: &Settings, state: &State) -> Vec<String> {
    let Some(tally) = Tally::of(settings, state) else { return Vec::new() };
    let mut doubts = Vec::new();
    if tally.diverges() {
        doubts.push(format!(
            "{}: the steps are too long for the curvature of the density there, and draws from that region are \
             missing; raise `target_acceptance` above {} or narrow the priors",
            tally.divergences(),
            settings.target_acceptance
        ));
    }
    if tally.saturated > 0 {
        doubts.push(format!(
            "{} of {} trajectories after the warm-up were cut off at the largest depth before they turned back: \
             successive draws are strongly correlated; raise `depth`, or learn all correlations with \
             `metric = \"dense\"`",
            tally.saturated, tally.all
        ));
    }
    doubts
}

/// Returns a note on divergences that are too few to distrust the draws.
pub(crate) fn notes(settings: &Settings, state: &State) -> Vec<String> {
    let few = |tally: &Tally| tally.divergent > 0 && !tally.diverges();
    let note = |tally: Tally| {
        format!(
            "{}, which is few enough to use the draws; to check whether they matter, repeat the run with a \
             `target_acceptance` above {}",
            tally.divergences(),
            settings.target_acceptance
        )
    };
    Tally::of(settings, state).filter(few).map(note).into_iter().collect()
}

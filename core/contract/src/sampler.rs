//! Contract of samplers.

mod harvest;
mod targets;

use lacuna::data::Draws;
use lacuna::diagnose::{autocorrelation, chains};
use lacuna::math::moments::{mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna::plugin::sampler::{Harvest, Sampler, State};

use crate::judge::{self, Check};
use targets::{Bounded, MEAN, Normal, SD};

/// Largest number of walkers of a small ensemble, and the steps with which it is tested.
const SMALL: usize = 12;
const MANY: usize = 20_000;

/// Number of steps after the warm-up that suffices to compare two runs.
const FEW: usize = 20;

/// Tests a sampler against its contract.
///
/// - The plan has chains, and steps beyond its warm-up unless the sampler implements `harvest`.
/// - `start` and `step` keep one finite point per chain, inside the support, with the log density of that very point;
///   so does the harvest.
/// - A state that is written and read again continues with the same bits, up to the harvest if there is one.
/// - The number of threads changes nothing.
/// - A wrong number of starting points is rejected, and so are points outside the support or non-finite ones unless the
///   sampler draws its own.
/// - Mean and standard deviation of a normal distribution in two correlated coordinates are reproduced within four
///   Monte Carlo errors, from the steps after the warm-up or from the harvest, whose draws are in random order and have
///   the stated effective size.
/// - A log evidence is correct within a tenth or four of its standard errors.
///
/// A sampler that implements `harvest` returns it for every state: before its last step it returns points or an error,
/// never `None`.
pub fn sampler(name: &str, sampler: &dyn Sampler) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 6] = [
        ("plans a run", Box::new(|| plans_a_run(sampler))),
        ("keeps sound states", Box::new(|| keeps_sound_states(sampler))),
        ("continues from a saved state", Box::new(|| continues_from_a_saved_state(sampler))),
        (
            "does not depend on threads",
            Box::new(|| judge::same_on_threads(|| Run::whole(sampler, &Normal, FEW))),
        ),
        ("refuses bad starting points", Box::new(|| refuses_bad_starts(sampler))),
        ("draws a normal law", Box::new(|| draws_a_normal_law(sampler))),
    ];
    judge::judge("sampler", name, &checks)
}

/// A run up to a certain step.
#[derive(PartialEq)]
struct Run {
    step: usize,
    state: State,
    harvest: Option<Harvest>,
}

impl Run {
    fn begin(sampler: &dyn Sampler, target: &dyn Target) -> Result<Self, String> {
        let count = sampler.plan(target.dimension()).chains;
        let points = target.prior_draws(count, &Stream::root(1).named("start"));
        let state = sampler
            .start(target, points)
            .map_err(|stop| format!("draws of the prior are refused: {stop}"))?;
        Ok(Self { step: 0, state, harvest: None })
    }

    /// Continues until `steps` steps have been made, or the sampler has finished.
    fn advance(
        &mut self,
        sampler: &dyn Sampler,
        target: &dyn Target,
        steps: usize,
    ) -> Result<(), String> {
        let stream = Stream::root(1).named("step");
        while self.step < steps && !sampler.finished(&self.state) {
            sampler
                .step(target, &mut self.state, &stream.at(self.step as u64))
                .map_err(|stop| format!("step {} stops: {stop}", self.step))?;
            self.step += 1;
        }
        Ok(())
    }

    /// Continues to `few` steps beyond the warm-up, or to the harvest.
    fn complete(
        &mut self,
        sampler: &dyn Sampler,
        target: &dyn Target,
        few: usize,
    ) -> Result<(), String> {
        let plan = sampler.plan(target.dimension());
        if harvests(sampler, target, &self.state) {
            self.advance(sampler, target, plan.steps)?;
            self.harvest = sampler
                .harvest(target, &self.state, &Stream::root(1).named("harvest"))
                .map_err(|stop| format!("the harvest after {} steps fails: {stop}", self.step))?;
            return Ok(());
        }
        self.advance(sampler, target, plan.warm_up + few)
    }

    fn whole(sampler: &dyn Sampler, target: &dyn Target, few: usize) -> Result<Self, String> {
        let mut run = Self::begin(sampler, target)?;
        run.complete(sampler, target, few)?;
        Ok(run)
    }
}

/// Returns true if the points of the steps are not draws.
fn harvests(sampler: &dyn Sampler, target: &dyn Target, state: &State) -> bool {
    !matches!(sampler.harvest(target, state, &Stream::root(1).named("harvest")), Ok(None))
}

fn plans_a_run(sampler: &dyn Sampler) -> Result<(), String> {
    let plan = sampler.plan(2);
    if plan.chains == 0 || plan.steps == 0 {
        return Err(format!("{} chains of {} steps are no run", plan.chains, plan.steps));
    }
    let run = Run::begin(sampler, &Normal)?;
    if plan.warm_up >= plan.steps && !harvests(sampler, &Normal, &run.state) {
        let (steps, warm_up) = (plan.steps, plan.warm_up);
        return Err(format!("a warm-up of {warm_up} leaves no draws of {steps} steps"));
    }
    Ok(())
}

fn keeps_sound_states(sampler: &dyn Sampler) -> Result<(), String> {
    let mut run = Run::begin(sampler, &Bounded)?;
    for step in 0..50 {
        run.advance(sampler, &Bounded, step)?;
        is_sound(&run.state, sampler.plan(2).chains)
            .map_err(|breach| format!("after {step} steps {breach}"))?;
    }
    if run.state.evaluations == 0 {
        return Err("evaluations are not counted".into());
    }
    if harvests(sampler, &Bounded, &run.state) {
        run.complete(sampler, &Bounded, FEW)?;
    }
    let Some(found) = &run.harvest else { return Ok(()) };
    harvest::is_sound(found, &Bounded, Bounded::holds)?;
    found.evidence.as_ref().map_or(Ok(()), |evidence| harvest::evidence_is(evidence, 0.0))
}

fn is_sound(state: &State, chains: usize) -> Result<(), String> {
    let shape = (state.points.rows(), state.points.columns());
    if shape != (chains, 2) || state.log_density.len() != chains || state.accepted.len() != chains {
        return Err("the state has not one entry a chain".into());
    }
    if let Some(point) = state.points.iter_rows().find(|point| !Bounded::holds(point)) {
        return Err(format!("a chain is outside the support at {point:?}"));
    }
    if state.log_density != Bounded.log_density(&state.points) {
        return Err("a log density is not that of its point".into());
    }
    Ok(())
}

fn continues_from_a_saved_state(sampler: &dyn Sampler) -> Result<(), String> {
    let mut run = Run::begin(sampler, &Normal)?;
    run.advance(sampler, &Normal, 7)?;
    let saved = serde_json::to_string(&run.state).map_err(|e| format!("cannot be written: {e}"))?;
    let state: State =
        serde_json::from_str(&saved).map_err(|e| format!("cannot be read again: {e}"))?;
    let mut read = Run { step: run.step, state, harvest: None };
    run.complete(sampler, &Normal, FEW)?;
    read.complete(sampler, &Normal, FEW)?;
    if run == read { Ok(()) } else { Err("the continued chain is another one".into()) }
}

fn refuses_bad_starts(sampler: &dyn Sampler) -> Result<(), String> {
    let chains = sampler.plan(2).chains;
    let good = Bounded.prior_draws(chains, &Stream::root(1).named("start"));
    let with = |value: f64| {
        let mut points = good.clone();
        points[(chains / 2, 1)] = value;
        points
    };
    let short = good.select_rows(&(1..chains).collect::<Vec<_>>());
    if sampler.uses_starts() {
        for (what, points) in [
            ("a point outside the support", with(1.5)),
            ("a point that is not a number", with(f64::NAN)),
        ] {
            judge::refused(what, || sampler.start(&Bounded, points))?;
        }
    } else {
        sampler.start(&Bounded, with(1.5)).map_err(|stop| {
            format!("it makes its own starting points, and stops at one that it ignores: {stop}")
        })?;
    }
    judge::refused("one point too few", || sampler.start(&Bounded, short))?;
    Ok(())
}

fn draws_a_normal_law(sampler: &dyn Sampler) -> Result<(), String> {
    let mut run = Run::begin(sampler, &Normal)?;
    if !harvests(sampler, &Normal, &run.state) {
        return follows_the_normal_law(sampler, run);
    }
    run.complete(sampler, &Normal, FEW)?;
    let found = run.harvest.ok_or("there is nothing to harvest after the last step")?;
    harvest::is_sound(&found, &Normal, |point| point.iter().all(|x| x.is_finite()))?;
    for j in 0..2 {
        is_normal(&found.points.column(j), j, harvest::errors(&found, j))?;
    }
    harvest::is_in_random_order(&found)?;
    let expected = Normal::log_evidence();
    found.evidence.as_ref().map_or(Ok(()), |evidence| harvest::evidence_is(evidence, expected))
}

/// Tests the steps of a run as draws.
fn follows_the_normal_law(sampler: &dyn Sampler, mut run: Run) -> Result<(), String> {
    let plan = sampler.plan(2);
    // Long enough for a sharp test, short enough for every test run.
    let steps = plan.steps.clamp(1000, 4000);
    // In an ensemble of few walkers a walker that is its own partner changes the law by a few percent.
    let steps = if plan.ensemble && plan.chains <= SMALL { MANY } else { steps };
    let first = plan.warm_up.max(steps / 4);
    run.advance(sampler, &Normal, first)?;
    let mut kept = Vec::new();
    for step in first..first + steps - steps / 4 {
        run.advance(sampler, &Normal, step + 1)?;
        kept.push((run.state.points.clone(), run.state.log_density.clone()));
    }
    let draws = Draws::from_steps(vec!["x".into(), "y".into()], &kept);
    let error = |values: &[Vec<f64>]| {
        if plan.ensemble {
            autocorrelation::ensemble_error(values)
        } else {
            chains::mcse_mean(values)
        }
    };
    for j in 0..2 {
        let values: Vec<Vec<f64>> = draws.coordinate(j).collect();
        let squares: Vec<Vec<f64>> =
            values.iter().map(|c| c.iter().map(|x| (x - MEAN[j]).powi(2)).collect()).collect();
        // The delta method converts the error of the variance into that of the standard deviation.
        is_normal(&draws.pooled(j), j, (error(&values), error(&squares) / (2.0 * SD[j])))?;
    }
    Ok(())
}

/// Compares mean and standard deviation of coordinate `j` with the exact values, given their errors.
fn is_normal(values: &[f64], j: usize, (of_mean, of_sd): (f64, f64)) -> Result<(), String> {
    let coordinate = j + 1;
    for (what, found, expected, error) in
        [("mean", mean(values), MEAN[j], of_mean), ("sd", variance(values).sqrt(), SD[j], of_sd)]
    {
        if error.is_nan() || (found - expected).abs() > 4.0 * error {
            return Err(format!(
                "the {what} of coordinate {coordinate} is {found} and not {expected}, \
                 with a Monte Carlo error of {error}"
            ));
        }
        if error > 0.1 * SD[j] {
            return Err(format!("the {what} of coordinate {coordinate} is known to {error} only"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;

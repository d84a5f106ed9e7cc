//! Integration from stop to stop up to the last time.

use nalgebra::{DMatrix, Schur};

use super::Sink;
use super::jumps::Jumps;
use super::stepper::Stepper;
use crate::models::equations::flow::{Flow, Start, describe};
use crate::models::equations::options::Solver;
use crate::models::equations::stops::Stop;

/// Number of accepted steps between two tests for stiffness.
const LOOK: usize = 25;

/// Product of the step and the fastest decay rate above which stability, and not accuracy, limits an explicit step;
/// the stability limit of the method itself is near 3.5.
const STIFF: f64 = 2.0;

/// Number of consecutive tests that must find a system stiff.
const LOOKS: usize = 3;

/// Product of the fastest decay rate and the time between two stops below which a system is not called stiff. An
/// explicit method needs about a third of this number of steps between the stops; an implicit one, which starts anew at
/// each stop, is slower than that (measured on a drive with dry friction under a force held between 1240 readings).
const WORTH: f64 = 300.0;

/// Maximum number of sweeps of the search for eigenvalues.
const SWEEPS: usize = 1000;

/// A run in progress.
pub struct March<'r, 'f> {
    flow: &'r Flow<'f>,
    solver: &'r Solver,
    times: &'r [f64],
    /// True if the run ends when the system is stiff.
    watched: bool,
    jumps: Jumps<'r, 'f>,
    states: Vec<f64>,
    sensitivities: Vec<f64>,
    /// Index of the first time that has not been reached.
    next: usize,
    steps: usize,
    stiff: usize,
    /// Time from the last stop to the next one.
    piece: f64,
    /// Largest magnitude of each state.
    pub peaks: Vec<f64>,
}

impl<'r, 'f> March<'r, 'f> {
    pub fn new(
        flow: &'r Flow<'f>,
        start: &Start,
        solver: &'r Solver,
        times: &'r [f64],
        watched: bool,
    ) -> Self {
        Self {
            flow,
            solver,
            times,
            watched,
            jumps: Jumps::new(flow, start),
            states: start.states.clone(),
            sensitivities: start.sensitivities.clone(),
            next: 0,
            steps: 0,
            stiff: 0,
            piece: 0.0,
            peaks: start.states.iter().map(|y| y.abs()).collect(),
        }
    }

    /// Integrates to the last time; returns the number of steps.
    pub fn run(
        &mut self,
        stepper: &mut dyn Stepper,
        stops: &[Stop],
        sink: &mut Sink<'_>,
    ) -> Result<usize, String> {
        while self.times.get(self.next).is_some_and(|time| *time <= stepper.time()) {
            sink(self.next, &self.states, &self.sensitivities);
            self.next += 1;
        }
        let end = Stop { before: self.times[self.times.len() - 1], jump: None };
        for stop in stops.iter().chain([&end]) {
            let reached = stop.jump.map_or(stop.before, |(after, _)| after);
            self.piece = stop.before - stepper.time();
            let mut stopped = !stepper.stop_at(stop.before);
            while !stopped {
                stopped = self.step(stepper)?;
                let until = if stopped { reached } else { stepper.time() };
                self.emit(until, stepper, sink)?;
                self.jumps.look(stepper);
            }
            self.emit(reached, stepper, sink)?;
            if let Some((after, index)) = stop.jump {
                self.jumps.cross(stepper, after, index);
            }
        }
        Ok(self.steps)
    }

    /// Passes on all times up to `until`; a time beyond the present by rounding is given the present values.
    fn emit(
        &mut self,
        until: f64,
        stepper: &mut dyn Stepper,
        sink: &mut Sink<'_>,
    ) -> Result<(), String> {
        while let Some(time) = self.times.get(self.next).filter(|time| **time <= until) {
            let time = time.min(stepper.time());
            let (states, sensitivities) = (&mut self.states, &mut self.sensitivities);
            stepper.interpolate(time, states, sensitivities)?;
            sink(self.next, states, sensitivities);
            self.next += 1;
        }
        Ok(())
    }

    /// Makes one step; returns true if it ends at the stop.
    fn step(&mut self, stepper: &mut dyn Stepper) -> Result<bool, String> {
        let before = stepper.time();
        let stopped = stepper.step().map_err(|reason| self.failed(stepper, &reason))?;
        self.steps += 1;
        for (peak, y) in self.peaks.iter_mut().zip(stepper.states()) {
            *peak = peak.max(y.abs());
        }
        if stepper.states().iter().any(|y| !y.is_finite()) {
            return Err(self.failed(stepper, "a state is not finite"));
        }
        if !stopped && stepper.time() <= before {
            return Err(self.failed(stepper, "no step is short enough for the tolerance"));
        }
        if self.steps >= self.solver.steps && !stopped {
            let reason = format!("{} steps are not enough", self.steps);
            return Err(self.failed(stepper, &reason));
        }
        if self.watched && self.steps.is_multiple_of(LOOK) && self.is_stiff(stepper) {
            return Err(self.failed(stepper, "the system is stiff"));
        }
        Ok(stopped)
    }

    fn failed(&self, stepper: &dyn Stepper, reason: &str) -> String {
        let system = self.flow.system;
        let place = describe(system, stepper.time(), stepper.states());
        match self.flow.undefined() {
            Some(undefined)
                if (undefined.time - stepper.time()).abs() <= stepper.length().abs() =>
            {
                format!("the integration stopped at {place}: {}", undefined.describe(system))
            }
            _ => format!("the integration stopped at {place}: {reason}"),
        }
    }

    /// Returns true if the last tests have all found that decay limits the steps, and to so many of them that an implicit
    /// method is worth its start.
    fn is_stiff(&mut self, stepper: &dyn Stepper) -> bool {
        let n = stepper.states().len();
        let mut jacobian = DMatrix::zeros(n, n);
        let mut direction = vec![0.0; n];
        for (j, mut column) in jacobian.column_iter_mut().enumerate() {
            direction[j] = 1.0;
            let out = column.as_mut_slice();
            self.flow.along(stepper.time(), stepper.states(), &direction, out);
            direction[j] = 0.0;
        }
        let Some(schur) = Schur::try_new(jacobian, f64::EPSILON, SWEEPS) else { return false };
        let eigenvalues = schur.complex_eigenvalues();
        let decay = eigenvalues.iter().map(|value| -value.re).fold(0.0, f64::max);
        let stiff = decay * stepper.length() > STIFF && decay * self.piece > WORTH;
        self.stiff = if stiff { self.stiff + 1 } else { 0 };
        self.stiff >= LOOKS
    }
}

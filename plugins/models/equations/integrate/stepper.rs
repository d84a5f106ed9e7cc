//! Implicit steps by diffsol, which only this module calls.

use std::marker::PhantomData;

use diffsol::error::OdeSolverError;
use diffsol::{
    DiffsolError, NalgebraContext, NalgebraLU, NalgebraMat, NalgebraVec, OdeBuilder,
    OdeEquationsImplicitSens, OdeSolverMethod, OdeSolverProblem, OdeSolverStopReason,
};

use crate::models::equations::flow::{Flow, Start};
use crate::models::equations::options::{Method, Solver};

type Linear = NalgebraLU<f64>;

/// Accuracy to which the sensitivities of an implicit step are solved, relative to their tolerance.
const SENSITIVITY_SOLVE: f64 = 0.02;

/// An integration method in progress.
pub trait Stepper {
    /// Makes one step; returns true if it ends at the stop.
    fn step(&mut self) -> Result<bool, String>;
    /// Sets the next stop; returns false if it is the present time.
    fn stop_at(&mut self, time: f64) -> bool;
    /// Returns the present time.
    fn time(&self) -> f64;
    /// Returns the length of the next step.
    fn length(&self) -> f64;
    /// Returns the present states.
    fn states(&self) -> &[f64];
    /// Writes the present sensitivities, channel by channel.
    fn sensitivities(&self, out: &mut [f64]);
    /// Writes the states and sensitivities at a time within the last step.
    fn interpolate(
        &mut self,
        time: f64,
        states: &mut [f64],
        sensitivities: &mut [f64],
    ) -> Result<(), String>;
    /// Continues from a time with the present states and these rates, sensitivities and rates of sensitivities.
    fn go_on(&mut self, time: f64, rates: &[f64], sensitivities: &[f64], their_rates: &[f64]);
}

/// Equations in the types used here.
trait Equations:
    OdeEquationsImplicitSens<T = f64, V = NalgebraVec<f64>, M = NalgebraMat<f64>, C = NalgebraContext>
{
}

impl<E> Equations for E where
    E: OdeEquationsImplicitSens<
            T = f64,
            V = NalgebraVec<f64>,
            M = NalgebraMat<f64>,
            C = NalgebraContext,
        >
{
}

/// Builds a stepper at the start and passes it to `make_use`.
pub fn with_stepper<R>(
    flow: &Flow<'_>,
    start: &Start,
    solver: &Solver,
    method: Method,
    absolute: &[f64],
    make_use: impl FnOnce(&mut dyn Stepper) -> Result<R, String>,
) -> Result<R, String> {
    let channels = flow.channels();
    let sizes: Vec<f64> = (0..channels).map(|channel| flow.size(channel)).collect();
    let relative = solver.relative_tolerance.get();
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .t0(start.time)
        .rtol(relative)
        .atol(absolute.iter().copied())
        .sens_rtol(relative)
        .sens_atol(absolute.iter().copied())
        .param_scales(sizes)
        .p(vec![0.0; channels])
        .rhs_sens_implicit(
            |y, _, t, out| flow.rates(t, y, out),
            |y, _, t, v, out| flow.along(t, y, v, out),
            |y, _, t, v, out| flow.by_channels(t, y, v, out),
        )
        .init_sens(
            |_, _, y| y.copy_from_slice(&start.states),
            |_, _, v, y| start.along(v, y),
            start.states.len(),
        )
        .build();
    let mut problem = problem.map_err(words)?;
    let options = &mut problem.ode_options;
    options.min_timestep = f64::MIN_POSITIVE;
    options.max_nonlinear_solver_failures = solver.steps;
    options.derivative_solve_tolerance = SENSITIVITY_SOLVE;
    choose(&problem, method, channels > 0, make_use)
}

fn choose<E: Equations, R>(
    problem: &OdeSolverProblem<E>,
    method: Method,
    sensitive: bool,
    make_use: impl FnOnce(&mut dyn Stepper) -> Result<R, String>,
) -> Result<R, String> {
    match (method == Method::Bdf, sensitive) {
        (true, false) => make_use(&mut Steps::new(problem.bdf::<Linear>().map_err(words)?)),
        (true, true) => make_use(&mut Steps::new(problem.bdf_sens::<Linear>().map_err(words)?)),
        (false, false) => make_use(&mut Steps::new(problem.esdirk34::<Linear>().map_err(words)?)),
        (false, true) => {
            make_use(&mut Steps::new(problem.esdirk34_sens::<Linear>().map_err(words)?))
        }
    }
}

/// A diffsol solver as a stepper.
struct Steps<'p, E: Equations + 'p, S: OdeSolverMethod<'p, E>> {
    solver: S,
    states: NalgebraVec<f64>,
    sensitivities: NalgebraVec<f64>,
    equations: PhantomData<&'p E>,
}

impl<'p, E: Equations + 'p, S: OdeSolverMethod<'p, E>> Steps<'p, E, S> {
    fn new(solver: S) -> Self {
        let state = solver.state();
        let (states, sensitivities) = (state.y.clone(), state.s.clone());
        Self { solver, states, sensitivities, equations: PhantomData }
    }
}

impl<'p, E: Equations + 'p, S: OdeSolverMethod<'p, E>> Stepper for Steps<'p, E, S> {
    fn step(&mut self) -> Result<bool, String> {
        let reason = self.solver.step().map_err(words)?;
        Ok(reason == OdeSolverStopReason::TstopReached)
    }

    fn stop_at(&mut self, time: f64) -> bool {
        self.solver.set_stop_time(time).is_ok()
    }

    fn time(&self) -> f64 {
        self.solver.state().t
    }

    fn length(&self) -> f64 {
        self.solver.state().h
    }

    fn states(&self) -> &[f64] {
        self.solver.state().y.batch_as_slice(0)
    }

    fn sensitivities(&self, out: &mut [f64]) {
        spread(self.solver.state().s, self.states().len(), out);
    }

    fn interpolate(
        &mut self,
        time: f64,
        states: &mut [f64],
        sensitivities: &mut [f64],
    ) -> Result<(), String> {
        self.solver.interpolate_inplace(time, &mut self.states).map_err(words)?;
        states.copy_from_slice(self.states.batch_as_slice(0));
        if !sensitivities.is_empty() {
            let into = &mut self.sensitivities;
            self.solver.interpolate_sens_inplace(time, into).map_err(words)?;
            spread(into, states.len(), sensitivities);
        }
        Ok(())
    }

    fn go_on(&mut self, time: f64, rates: &[f64], sensitivities: &[f64], their_rates: &[f64]) {
        let state = self.solver.state_mut();
        *state.t = time;
        state.dy.batch_as_mut_slice(0).copy_from_slice(rates);
        let both = sensitivities.chunks(rates.len()).zip(their_rates.chunks(rates.len()));
        for (channel, (value, rate)) in both.enumerate() {
            state.s.batch_as_mut_slice(channel).copy_from_slice(value);
            state.ds.batch_as_mut_slice(channel).copy_from_slice(rate);
        }
    }
}

/// Writes the lanes of a vector one after the other.
fn spread(vector: &NalgebraVec<f64>, length: usize, out: &mut [f64]) {
    for (channel, out) in out.chunks_mut(length).enumerate() {
        out.copy_from_slice(vector.batch_as_slice(channel));
    }
}

/// Describes an error of diffsol.
fn words(error: DiffsolError) -> String {
    match error {
        DiffsolError::OdeSolverError(
            OdeSolverError::StepSizeTooSmall { .. }
            | OdeSolverError::TooManyErrorTestFailures { .. },
        ) => "no step is short enough for the tolerance".to_owned(),
        DiffsolError::OdeSolverError(OdeSolverError::TooManyNonlinearSolverFailures { .. })
        | DiffsolError::NonLinearSolverError(_) => {
            "the equations of an implicit step could not be solved".to_owned()
        }
        other => other.to_string(),
    }
}

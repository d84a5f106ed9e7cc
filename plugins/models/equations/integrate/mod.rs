//! Integration of the states: explicit steps implemented here, implicit ones by diffsol.
//!
//! C. Tsitouras, Comput. Math. Appl. 62 (2011) 770; G. Byrne and A. Hindmarsh, ACM Trans. Math. Softw. 1 (1975) 71;
//! L. Shampine and M. Reichelt, SIAM J. Sci. Comput. 18 (1997) 1; J. Jørgensen, M. Kristensen and P. Thomsen, arXiv
//! 1803.01613 (2018). On stiffness: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, 2nd edition,
//! Springer 1996, section IV.2.

mod explicit;
mod jumps;
mod march;
mod stepper;

use lacuna::text::values::Positive;

use super::flow::{Flow, Start};
use super::options::{Method, Solver};
use super::stops::{Stop, stops};
use explicit::Explicit;
use march::March;
use stepper::with_stepper;

/// Number of discontinuities above which a method that restarts at each of them is too expensive.
const MANY_BREAKS: usize = 50;

/// Absolute tolerance divided by the relative one and the largest magnitude of the state.
const SHARE: f64 = 0.01;

/// Assumed magnitude of a state that starts at zero.
const SMALL: f64 = 1e-6;

/// Factor by which an absolute tolerance may be too large for its state before the run is repeated.
const TOO_LARGE: f64 = 3.0;

/// Receiver of the states and sensitivities (channel by channel) at each requested time, by the index of the time;
/// after a repeated run it is called again for all times.
pub type Sink<'k> = dyn FnMut(usize, &[f64], &[f64]) + 'k;

/// Cost of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Method that completed the run.
    pub method: Method,
    /// Number of steps.
    pub steps: usize,
}

/// Integrates over ascending times. Fails with a description if the integration cannot reach the last one.
pub fn integrate(
    flow: &Flow<'_>,
    solver: &Solver,
    times: &[f64],
    sink: &mut Sink<'_>,
) -> Result<Effort, String> {
    let start = Start::of(flow)?;
    let (first, last) = (times[0], times[times.len() - 1]);
    if first < start.time {
        let (name, begun) = (&flow.system.variables[0], start.time);
        return Err(format!("the first {name}, {first}, is before the start {name}, {begun}"));
    }
    let stops = stops(flow, (start.time, last), times);
    let stiff_method = if stops.len() > MANY_BREAKS { Method::Esdirk } else { Method::Bdf };
    let mut run = Run { flow, solver, times, start, stops, sink };
    match solver.method {
        Method::Auto => {
            run.with_tolerances(Method::RungeKutta).or_else(|_| run.with_tolerances(stiff_method))
        }
        method => run.with_tolerances(method),
    }
}

/// A run of one or more attempts.
struct Run<'r, 'f, 'k> {
    flow: &'r Flow<'f>,
    solver: &'r Solver,
    times: &'r [f64],
    start: Start,
    stops: Vec<Stop>,
    sink: &'r mut Sink<'k>,
}

impl Run<'_, '_, '_> {
    /// Integrates with one method; an implicit one repeats the run if an absolute tolerance has proved too large for
    /// its state.
    fn with_tolerances(&mut self, method: Method) -> Result<Effort, String> {
        let relative = self.solver.relative_tolerance.get();
        let share = SHARE * relative;
        if matches!(method, Method::Auto | Method::RungeKutta) {
            return self.explicit(relative, share);
        }
        if let Some(absolute) = self.solver.absolute_tolerance {
            let tolerances = vec![absolute.get(); self.start.states.len()];
            return self.once(method, &tolerances).map(|(effort, _)| effort);
        }
        let size = |x: &f64| share * if *x == 0.0 { 1.0 } else { x.abs() };
        let mut tolerances: Vec<f64> = self.start.states.iter().map(size).collect();
        let (effort, peaks) = self.once(method, &tolerances)?;
        let mut repeat = false;
        for (tolerance, peak) in tolerances.iter_mut().zip(peaks).filter(|(_, peak)| *peak > 0.0) {
            repeat |= *tolerance > TOO_LARGE * share * peak;
            *tolerance = share * peak;
        }
        if repeat { Ok(self.once(method, &tolerances)?.0) } else { Ok(effort) }
    }

    /// Integrates with the explicit method, whose absolute tolerances follow the states during the run.
    ///
    /// A state at zero has no magnitude: however short the step, the error of a state that starts to grow from zero
    /// is as large as the state. Such states start with a tolerance for a small magnitude; the run is repeated if
    /// that proved too large.
    fn explicit(&mut self, relative: f64, share: f64) -> Result<Effort, String> {
        let at_rest = |y: &f64| if *y == 0.0 { share * SMALL } else { 0.0 };
        let mut floors: Vec<f64> = self.start.states.iter().map(at_rest).collect();
        let (effort, peaks) = self.following(relative, share, &floors)?;
        let mut repeat = false;
        for (floor, peak) in floors.iter_mut().zip(peaks).filter(|(_, peak)| *peak > 0.0) {
            repeat |= *floor > share * peak;
            *floor = floor.min(share * SMALL * peak);
        }
        if repeat { Ok(self.following(relative, share, &floors)?.0) } else { Ok(effort) }
    }

    /// Makes one run with the explicit method; returns also the largest magnitude of each state.
    fn following(
        &mut self,
        relative: f64,
        share: f64,
        floors: &[f64],
    ) -> Result<(Effort, Vec<f64>), String> {
        let (flow, start) = (self.flow, &self.start);
        let absolute = self.solver.absolute_tolerance.map(Positive::get);
        let mut stepper = Explicit::new(flow, start, relative, absolute, share, floors);
        let watched = self.solver.method == Method::Auto;
        let mut march = March::new(flow, start, self.solver, self.times, watched);
        let steps = march.run(&mut stepper, &self.stops, self.sink)?;
        Ok((Effort { method: Method::RungeKutta, steps }, march.peaks))
    }

    /// Makes one run with an implicit method; returns also the largest magnitude of each state.
    fn once(&mut self, method: Method, absolute: &[f64]) -> Result<(Effort, Vec<f64>), String> {
        let (flow, start, sink) = (self.flow, &self.start, &mut *self.sink);
        with_stepper(flow, start, self.solver, method, absolute, |stepper| {
            let mut march = March::new(flow, start, self.solver, self.times, false);
            let steps = march.run(stepper, &self.stops, sink)?;
            Ok((Effort { method, steps }, march.peaks))
        })
    }
}

//! Rates of a system at a state and time, and their derivatives.

use std::cell::RefCell;

use lacuna::expression::{DIRECTIONS, Evaluator, Program};

use super::jacobian::Jacobian;
use super::system::System;

/// Replacement for a rate that is not finite: so large that every method rejects the step and tries a shorter one.
const UNDEFINED: f64 = 1e150;

/// Rates for given inputs.
pub struct Flow<'s> {
    pub system: &'s System,
    inputs: &'s [f64],
    /// Indices of the inputs with respect to which derivatives are taken.
    channels: &'s [usize],
    work: RefCell<Work<'s>>,
}

struct Work<'s> {
    rates: Evaluator<'s>,
    point: Vec<f64>,
    direction: Vec<f64>,
    /// Components of several directions by coordinate, and the slopes of each rate along them.
    directions: Vec<[f64; DIRECTIONS]>,
    slopes: Vec<[f64; DIRECTIONS]>,
    /// Derivatives of the rates by channels and states, if they take fewer operations than slopes along the sensitivities.
    jacobian: Option<Jacobian>,
    /// Last rate that was not finite.
    undefined: Option<Undefined>,
}

/// A rate that is not finite, and where it occurred.
#[derive(Debug, Clone)]
pub struct Undefined {
    /// Index of the state.
    pub state: usize,
    /// Value of the rate.
    pub value: f64,
    /// Time.
    pub time: f64,
    /// States.
    pub states: Vec<f64>,
}

impl<'s> Flow<'s> {
    pub fn new(system: &'s System, inputs: &'s [f64], channels: &'s [usize]) -> Self {
        let coordinates = system.coordinates();
        let mut point = vec![0.0; coordinates];
        let variables = system.variables.len();
        point[variables..variables + inputs.len()].copy_from_slice(inputs);
        let mut rates = Evaluator::new(&system.rates);
        let jacobian = Jacobian::new(&mut rates, system, channels);
        let work = Work {
            rates,
            point,
            direction: vec![0.0; coordinates],
            directions: vec![[0.0; DIRECTIONS]; coordinates],
            slopes: vec![[0.0; DIRECTIONS]; system.states.len()],
            jacobian,
            undefined: None,
        };
        Self { system, inputs, channels, work: RefCell::new(work) }
    }

    /// Returns the number of inputs with respect to which derivatives are taken.
    pub fn channels(&self) -> usize {
        self.channels.len()
    }

    /// Returns a point of the system's programs: time, inputs and states.
    pub fn point(&self, time: f64, states: &[f64]) -> Vec<f64> {
        [&[time], self.inputs, states].concat()
    }

    /// Returns the coordinate of a channel's input in a point.
    pub fn coordinate(&self, channel: usize) -> usize {
        self.system.variables.len() + self.channels[channel]
    }

    /// Returns the magnitude of a channel's input, which scales its sensitivities.
    pub fn size(&self, channel: usize) -> f64 {
        let size = self.inputs[self.channels[channel]].abs();
        if size == 0.0 { 1.0 } else { size }
    }

    /// Computes the rates; one that is not finite is replaced by [`UNDEFINED`] and recorded.
    pub fn rates(&self, time: f64, states: &[f64], out: &mut [f64]) {
        let mut work = self.work.borrow_mut();
        work.go(time, states);
        work.rates.values(out);
        for (state, rate) in out.iter_mut().enumerate() {
            if !rate.is_finite() {
                let (value, states) = (*rate, states.to_vec());
                // States that are not finite belong to a failed trial step and are not recorded.
                if states.iter().all(|x| x.is_finite()) {
                    work.undefined = Some(Undefined { state, value, time, states });
                }
                *rate = UNDEFINED;
            }
        }
    }

    /// Computes the derivatives of the rates along a direction of the states.
    pub fn along(&self, time: f64, states: &[f64], direction: &[f64], out: &mut [f64]) {
        let mut work = self.work.borrow_mut();
        let first = work.direction.len() - states.len();
        work.direction[..first].fill(0.0);
        work.direction[first..].copy_from_slice(direction);
        work.slopes(time, states, out);
    }

    /// Computes the derivatives of the rates along a direction of the channels.
    pub fn by_channels(&self, time: f64, states: &[f64], direction: &[f64], out: &mut [f64]) {
        let mut work = self.work.borrow_mut();
        work.direction.fill(0.0);
        for (channel, share) in direction.iter().enumerate() {
            work.direction[self.coordinate(channel)] = *share;
        }
        work.slopes(time, states, out);
    }

    /// Computes the rate of a channel's sensitivity, `∂f/∂y s + ∂f/∂p`.
    pub fn sensitivity_rate(
        &self,
        time: f64,
        states: &[f64],
        channel: usize,
        sensitivity: &[f64],
        out: &mut [f64],
    ) {
        let mut work = self.work.borrow_mut();
        let first = work.direction.len() - states.len();
        work.direction.fill(0.0);
        work.direction[self.coordinate(channel)] = 1.0;
        work.direction[first..].copy_from_slice(sensitivity);
        work.slopes(time, states, out);
    }

    /// Computes the rates of the states followed by those of the sensitivities, channel by channel.
    pub fn all(&self, time: f64, values: &[f64], out: &mut [f64]) {
        let count = self.system.states.len();
        let (states, sensitivities) = values.split_at(count);
        let (rates, their_rates) = out.split_at_mut(count);
        self.rates(time, states, rates);
        if sensitivities.is_empty() {
            return;
        }
        let mut work = self.work.borrow_mut();
        let first = work.direction.len() - count;
        let Work { rates: evaluator, directions, slopes, jacobian, .. } = &mut *work;
        if jacobian.as_mut().is_some_and(|j| j.apply(evaluator, sensitivities, their_rates)) {
            return;
        }
        let some = sensitivities.chunks(DIRECTIONS * count);
        let both = some.zip(their_rates.chunks_mut(DIRECTIONS * count));
        for (chunk, (sensitivities, rates)) in both.enumerate() {
            directions.fill([0.0; DIRECTIONS]);
            for (l, sensitivity) in sensitivities.chunks(count).enumerate() {
                directions[self.coordinate(chunk * DIRECTIONS + l)][l] = 1.0;
                for (direction, s) in directions[first..].iter_mut().zip(sensitivity) {
                    direction[l] = *s;
                }
            }
            evaluator.slopes_together(directions, slopes);
            for (l, rates) in rates.chunks_mut(count).enumerate() {
                for (rate, slope) in rates.iter_mut().zip(&*slopes) {
                    *rate = defined(slope[l]);
                }
            }
        }
    }

    /// Returns the last rate that was not finite.
    pub fn undefined(&self) -> Option<Undefined> {
        self.work.borrow().undefined.clone()
    }
}

impl Work<'_> {
    fn go(&mut self, time: f64, states: &[f64]) {
        let first = self.point.len() - states.len();
        self.point[0] = time;
        self.point[first..].copy_from_slice(states);
        self.rates.at(&self.point);
    }

    fn slopes(&mut self, time: f64, states: &[f64], out: &mut [f64]) {
        self.go(time, states);
        self.rates.slopes(&self.direction, out);
        for slope in out {
            *slope = defined(*slope);
        }
    }
}

/// Replaces a slope that is not finite by zero: either the rate is not finite there, or the slope is infinite at the
/// edge of the domain of the rate.
pub(super) fn defined(slope: f64) -> f64 {
    if slope.is_finite() { slope } else { 0.0 }
}

/// Start of a run.
pub struct Start {
    pub time: f64,
    pub states: Vec<f64>,
    /// Derivative of the states with respect to each channel, channel by channel.
    pub sensitivities: Vec<f64>,
}

impl Start {
    /// Computes the initial values and their derivatives at a fixed time: a start later by `dt` means that the states
    /// lag by their rates times `dt`. Fails if a value is not finite.
    pub fn of(flow: &Flow<'_>) -> Result<Self, String> {
        let system = flow.system;
        let states = system.states.len();
        let point = flow.point(0.0, &vec![0.0; states]);
        let mut start = Evaluator::new(&system.start);
        let mut values = vec![0.0; 1 + states];
        start.at(&point);
        start.values(&mut values);
        let time = values.remove(0);
        let variable = &system.variables[0];
        if !time.is_finite() {
            return Err(format!("the start {variable} is {time}"));
        }
        if let Some(i) = values.iter().position(|value| !value.is_finite()) {
            return Err(format!("the start value of `{}` is {}", system.states[i], values[i]));
        }
        let mut rates = vec![0.0; states];
        flow.rates(time, &values, &mut rates);
        if let Some(undefined) = flow.undefined() {
            return Err(undefined.describe(system));
        }
        let mut sensitivities = vec![0.0; flow.channels() * states];
        let mut slopes = vec![0.0; 1 + states];
        for (channel, sensitivity) in sensitivities.chunks_mut(states).enumerate() {
            let mut direction = vec![0.0; point.len()];
            direction[flow.coordinate(channel)] = 1.0;
            start.slopes(&direction, &mut slopes);
            for (i, s) in sensitivity.iter_mut().enumerate() {
                *s = slopes[1 + i] - rates[i] * slopes[0];
            }
        }
        Ok(Self { time, states: values, sensitivities })
    }

    /// Computes the derivative of the states along a direction of the channels.
    pub fn along(&self, direction: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (share, sensitivity) in direction.iter().zip(self.sensitivities.chunks(out.len())) {
            out.iter_mut().zip(sensitivity).for_each(|(out, s)| *out += share * s);
        }
    }
}

impl Undefined {
    /// Describes the rate for a message.
    pub fn describe(&self, system: &System) -> String {
        let name = &system.states[self.state];
        let at = describe(system, self.time, &self.states);
        format!("the rate of `{name}` is {} at {at}", self.value)
    }
}

/// Formats a time and states, such as `t = 0.5, x = 1, y = 2`; of many states only the first.
pub fn describe(system: &System, time: f64, states: &[f64]) -> String {
    const SHOWN: usize = 6;
    let each = system.states.iter().zip(states).take(SHOWN);
    let each: Vec<String> = each.map(|(name, value)| format!("{name} = {value}")).collect();
    let rest = if states.len() > SHOWN { ", …" } else { "" };
    format!("{} = {time}, {}{rest}", system.variables[0], each.join(", "))
}

/// Evaluator of a program with one output and its derivatives.
pub struct Quantity<'p>(pub Evaluator<'p>);

impl<'p> Quantity<'p> {
    pub fn new(program: &'p Program) -> Self {
        Self(Evaluator::new(program))
    }

    /// Returns the value at a point.
    pub fn value(&mut self, point: &[f64]) -> f64 {
        let mut out = [0.0];
        self.0.at(point);
        self.0.values(&mut out);
        out[0]
    }

    /// Returns the derivative at a point along a direction.
    pub fn slope(&mut self, point: &[f64], direction: &[f64]) -> f64 {
        let mut out = [0.0];
        self.0.at(point);
        self.0.slopes(direction, &mut out);
        out[0]
    }
}

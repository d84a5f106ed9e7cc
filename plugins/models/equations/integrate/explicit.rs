//! Explicit method: the pair of orders 5 and 4 of Tsitouras with its interpolation; states and sensitivities are
//! integrated together.
//!
//! C. Tsitouras, Comput. Math. Appl. 62 (2011) 770, with the coefficients of the interpolation given there; the step
//! size control is that of E. Hairer, S. Nørsett and G. Wanner, Solving Ordinary Differential Equations I, 2nd
//! edition, Springer 1993, section II.4.

use super::stepper::Stepper;
use crate::models::equations::flow::{Flow, Start};

const STAGES: usize = 7;

/// Nodes `c` of the stages.
const PLACES: [f64; STAGES] = [0.0, 0.161, 0.327, 0.9, 0.980_025_540_904_509_7, 1.0, 1.0];

/// Coefficients `a` of the earlier stages in each stage; those of the last one are the weights of the solution.
#[rustfmt::skip]
const SHARES: [[f64; STAGES - 1]; STAGES] = [
    [0.0; 6],
    [0.161, 0.0, 0.0, 0.0, 0.0, 0.0],
    [-0.008_480_655_492_356_989, 0.335_480_655_492_357, 0.0, 0.0, 0.0, 0.0],
    [2.897_153_057_105_493_5, -6.359_448_489_975_075, 4.362_295_432_869_581_5, 0.0, 0.0, 0.0],
    [5.325_864_828_439_257, -11.748_883_564_062_828, 7.495_539_342_889_836_5, -0.092_495_066_361_755_25, 0.0, 0.0],
    [5.861_455_442_946_42, -12.920_969_317_847_11, 8.159_367_898_576_159, -0.071_584_973_281_401, -0.028_269_050_394_068_383, 0.0],
    [0.096_460_766_818_065_23, 0.01, 0.479_889_650_414_499_6, 1.379_008_574_103_742, -3.290_069_515_436_081, 2.324_710_524_099_774],
];

/// Weights of the solution of order 5 minus those of the solution of order 4.
const ERRORS: [f64; STAGES] = [
    -0.001_780_011_052_225_777,
    -0.000_816_434_459_656_746_9,
    0.007_880_878_010_261_995,
    -0.144_711_007_173_262_9,
    0.582_357_165_452_555_2,
    -0.458_082_105_929_186_97,
    0.015_151_515_151_515_152,
];

/// Polynomials of the interpolation: the weight of each stage as a function of the position in the step, from the
/// first power.
const BETWEEN: [[f64; 4]; STAGES] = [
    [1.0, -2.763_706_197_274_826, 2.913_255_461_821_912_6, -1.053_088_497_729_021_6],
    [0.0, 0.131_7, -0.223_4, 0.101_7],
    [0.0, 3.930_296_236_894_751_6, -5.941_033_872_131_505, 2.490_627_285_651_253],
    [0.0, -12.411_077_166_933_676, 30.338_188_630_282_32, -16.548_102_889_244_902],
    [0.0, 37.509_313_416_511_04, -88.178_904_894_766_4, 47.379_521_962_819_28],
    [0.0, -27.896_526_289_197_286, 65.091_894_674_793_66, -34.870_657_861_496_61],
    [0.0, 1.5, -4.0, 2.5],
];

/// Smallest and largest ratio of the lengths of successive steps.
const CHANGE: (f64, f64) = (0.2, 5.0);

/// Safety factor on the step length that the error allows.
const SAFETY: f64 = 0.9;

/// Upper limit of the first step, relative to the distance to the first stop.
const FIRST: f64 = 1e-3;

/// A run with the explicit method.
pub struct Explicit<'r, 'f> {
    flow: &'r Flow<'f>,
    relative: f64,
    /// Absolute tolerance of each state; those of its sensitivities are divided by the size of the input.
    absolute: Vec<f64>,
    /// Absolute tolerance relative to the largest magnitude of a state so far; `None` if the tolerance is fixed.
    following: Option<f64>,
    sizes: Vec<f64>,
    time: f64,
    stop: f64,
    /// Length of the next step, unless a stop is nearer; zero before the first.
    length: f64,
    /// Start and length of the last step.
    last: (f64, f64),
    /// States followed by the sensitivities, channel by channel: now, and at the start of the last step.
    now: Vec<f64>,
    before: Vec<f64>,
    trial: Vec<f64>,
    scratch: Vec<f64>,
    /// Rates at the stages of the last step; the last are those at the present time.
    rates: [Vec<f64>; STAGES],
}

impl<'r, 'f> Explicit<'r, 'f> {
    /// Starts a run. Without an absolute tolerance, the tolerances are the fraction `following` of the magnitudes of
    /// the states, but at least `floors`.
    pub fn new(
        flow: &'r Flow<'f>,
        start: &Start,
        relative: f64,
        absolute: Option<f64>,
        following: f64,
        floors: &[f64],
    ) -> Self {
        let now = [start.states.as_slice(), &start.sensitivities].concat();
        let absolute_of =
            |(y, floor): (&f64, &f64)| absolute.unwrap_or(floor.max(following * y.abs()));
        let mut rates: [Vec<f64>; STAGES] = std::array::from_fn(|_| vec![0.0; now.len()]);
        flow.all(start.time, &now, &mut rates[STAGES - 1]);
        Self {
            flow,
            relative,
            absolute: start.states.iter().zip(floors).map(absolute_of).collect(),
            following: absolute.is_none().then_some(following),
            sizes: (0..flow.channels()).map(|channel| flow.size(channel)).collect(),
            time: start.time,
            stop: start.time,
            length: 0.0,
            last: (start.time, 0.0),
            before: now.clone(),
            trial: now.clone(),
            scratch: now.clone(),
            now,
            rates,
        }
    }

    fn count(&self) -> usize {
        self.absolute.len()
    }

    /// Returns a first step that is short relative to the distance to the first stop and to the time in which a state
    /// changes.
    fn first_length(&self) -> f64 {
        let count = self.count();
        let both = self.now[..count].iter().zip(&self.rates[STAGES - 1][..count]);
        let times = both.filter(|(y, rate)| **y != 0.0 && **rate != 0.0);
        let times = times.map(|(y, rate)| 0.01 * (y / rate).abs());
        times.fold(FIRST * (self.stop - self.time), f64::min)
    }

    /// Computes the stages of a step of this length, and the values at its end in `trial`.
    fn stages(&mut self, length: f64) {
        for stage in 1..STAGES {
            let (done, rest) = self.rates.split_at_mut(stage);
            let shares = SHARES[stage].map(|share| length * share);
            combine(&self.now, &shares, done, &mut self.trial);
            self.flow.all(self.time + PLACES[stage] * length, &self.trial, &mut rest[0]);
        }
    }

    /// Returns the error of the trial step in units of the tolerance: the larger of the root mean squares over the
    /// states and over the sensitivities of each channel.
    fn error(&mut self, length: f64) -> f64 {
        let count = self.count();
        let shares = ERRORS.map(|share| length * share);
        weighted::<STAGES>(None, &shares, &self.rates, &mut self.scratch);
        let mut largest = 0.0_f64;
        for first in (0..self.now.len()).step_by(count) {
            let size = if first == 0 { 1.0 } else { self.sizes[first / count - 1] };
            let mut sum = 0.0;
            for i in first..first + count {
                let error = self.scratch[i];
                if error != 0.0 {
                    let magnitude = self.now[i].abs().max(self.trial[i].abs());
                    let absolute = self.absolute_with_trial(i - first) / size;
                    sum += (error / (self.relative * magnitude + absolute)).powi(2);
                }
            }
            if sum.is_nan() {
                return f64::INFINITY;
            }
            largest = largest.max(sum / count as f64);
        }
        largest.sqrt()
    }

    fn absolute_with_trial(&self, state: usize) -> f64 {
        let follow = |share| share * f64::abs(self.trial[state]);
        self.following.map_or(0.0, follow).max(self.absolute[state])
    }
}

/// Writes `from` plus the rates of the stages so far times their shares, element by element.
fn combine(from: &[f64], shares: &[f64], rates: &[Vec<f64>], to: &mut [f64]) {
    match rates.len() {
        1 => weighted::<1>(Some(from), shares, rates, to),
        2 => weighted::<2>(Some(from), shares, rates, to),
        3 => weighted::<3>(Some(from), shares, rates, to),
        4 => weighted::<4>(Some(from), shares, rates, to),
        5 => weighted::<5>(Some(from), shares, rates, to),
        _ => weighted::<6>(Some(from), shares, rates, to),
    }
}

/// Writes `from`, or zero, plus the rates of the first `N` stages times their shares, element by element.
fn weighted<const N: usize>(
    from: Option<&[f64]>,
    shares: &[f64],
    rates: &[Vec<f64>],
    to: &mut [f64],
) {
    let count = to.len();
    let stages: [(f64, &[f64]); N] = std::array::from_fn(|k| (shares[k], &rates[k][..count]));
    for (i, to) in to.iter_mut().enumerate() {
        let first = from.map_or(0.0, |from| from[i]);
        *to = stages.iter().fold(first, |sum, (share, rates)| sum + share * rates[i]);
    }
}

/// Returns the ratio of the next step to the last for this error, in units of the tolerance.
fn change(error: f64) -> f64 {
    let (least, most) = CHANGE;
    // Below the fifth power of the bound the limit applies anyway; this saves the power, because nearly all errors
    // are so small if stops are dense.
    if error < (SAFETY / most).powi(5) {
        return most;
    }
    (SAFETY * error.powf(-0.2)).clamp(least, most)
}

impl Stepper for Explicit<'_, '_> {
    fn step(&mut self) -> Result<bool, String> {
        if self.length == 0.0 {
            self.length = self.first_length();
        }
        self.rates.swap(0, STAGES - 1);
        loop {
            let rest = self.stop - self.time;
            // Rather a slightly longer step than a tiny one to the stop.
            let stops = 1.01 * self.length >= rest;
            let length = if stops { rest } else { self.length };
            let end = if stops { self.stop } else { self.time + length };
            if end <= self.time {
                return Err("no step is short enough for the tolerance".to_owned());
            }
            self.stages(length);
            let error = self.error(length);
            let change = change(error);
            if error <= 1.0 {
                for state in 0..self.count() {
                    self.absolute[state] = self.absolute_with_trial(state);
                }
                std::mem::swap(&mut self.before, &mut self.now);
                std::mem::swap(&mut self.now, &mut self.trial);
                self.last = (self.time, length);
                self.time = end;
                // A step shortened by a stop does not shorten the next one.
                self.length = (change * length).max(if stops { self.length } else { 0.0 });
                return Ok(stops);
            }
            self.length = change.min(SAFETY) * length;
        }
    }

    fn stop_at(&mut self, time: f64) -> bool {
        self.stop = time;
        time > self.time
    }

    fn time(&self) -> f64 {
        self.time
    }

    fn length(&self) -> f64 {
        if self.last.1 > 0.0 { self.last.1 } else { self.length }
    }

    fn states(&self) -> &[f64] {
        &self.now[..self.count()]
    }

    fn sensitivities(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.now[self.count()..]);
    }

    fn interpolate(
        &mut self,
        time: f64,
        states: &mut [f64],
        sensitivities: &mut [f64],
    ) -> Result<(), String> {
        let values = states.iter_mut().chain(sensitivities);
        let (begin, length) = self.last;
        if time >= self.time || length == 0.0 {
            values.zip(&self.now).for_each(|(value, now)| *value = *now);
            return Ok(());
        }
        let place = (time - begin) / length;
        let share =
            |[a, b, c, d]: [f64; 4]| length * place * (a + place * (b + place * (c + place * d)));
        let shares = BETWEEN.map(share);
        weighted::<STAGES>(Some(&self.before), &shares, &self.rates, &mut self.scratch);
        values.zip(&self.scratch).for_each(|(value, found)| *value = *found);
        Ok(())
    }

    fn go_on(&mut self, time: f64, rates: &[f64], sensitivities: &[f64], their_rates: &[f64]) {
        let count = self.count();
        self.time = time;
        self.now[count..].copy_from_slice(sensitivities);
        let (own, theirs) = self.rates[STAGES - 1].split_at_mut(count);
        own.copy_from_slice(rates);
        theirs.copy_from_slice(their_rates);
    }
}

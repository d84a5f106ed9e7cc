//! Sensitivities at jumps of the rates.
//!
//! At a time `t*(p)` at which the rates change from `f⁻` to `f⁺` the states are continuous, but their derivatives
//! with respect to an input `p` are not: `s⁺ = s⁻ + (f⁻ - f⁺) dt*/dp`. With `q(t, y, p)` the quantity that reaches
//! its value there, `dt*/dp = -(q_y s⁻ + q_p) / (q_t + q_y f⁻)`. E. Rozenwasser and R. Yusupov, Sensitivity of
//! Automatic Control Systems, CRC 2000, chapter 2.

use lacuna::expression::Break;

use super::stepper::Stepper;
use crate::models::equations::flow::{Flow, Quantity, Start};
use crate::models::equations::stops::depends_on_states;

/// Jumps of a system.
pub struct Jumps<'r, 'f> {
    flow: &'r Flow<'f>,
    /// Jumps at certain states, with the side on which the run is.
    by_states: Vec<Watched<'f>>,
    /// Time and states before the last step.
    before: (f64, Vec<f64>),
    /// For each break of the system: true if no input moves it, so that its jumps leave the sensitivities continuous.
    fixed: Vec<bool>,
    /// States and sensitivities after a fixed jump, and their rates.
    values: Vec<f64>,
    rates: Vec<f64>,
}

struct Watched<'f> {
    index: usize,
    quantity: Quantity<'f>,
    value: f64,
    above: bool,
}

impl<'r, 'f> Jumps<'r, 'f> {
    pub fn new(flow: &'r Flow<'f>, start: &Start) -> Self {
        let mut by_states = Vec::new();
        // Without sensitivities no correction is needed: the step size control resolves the jump.
        let breaks = flow.system.breaks.iter().enumerate().filter(|_| flow.channels() > 0);
        for (index, broken) in breaks.filter(|(_, b)| b.jumps && depends_on_states(b, flow)) {
            let mut quantity = Quantity::new(&broken.quantity);
            let now = quantity.value(&flow.point(start.time, &start.states));
            by_states.extend(broken.at.iter().map(|&value| {
                let quantity = Quantity::new(&broken.quantity);
                Watched { index, quantity, value, above: now > value }
            }));
        }
        let fixed = flow.system.breaks.iter().map(|broken| is_fixed(broken, flow)).collect();
        let before = (start.time, start.states.clone());
        let values = [start.states.as_slice(), &start.sensitivities].concat();
        Self { flow, by_states, before, fixed, rates: values.clone(), values }
    }

    /// Corrects the sensitivities if the last step has crossed a jump.
    pub fn look(&mut self, stepper: &mut dyn Stepper) {
        if self.by_states.is_empty() {
            return;
        }
        let point = self.flow.point(stepper.time(), stepper.states());
        let mut crossed = None;
        for watched in &mut self.by_states {
            let above = watched.quantity.value(&point) > watched.value;
            if above != watched.above {
                watched.above = above;
                crossed = Some(watched.index);
            }
        }
        let before = self.before.clone();
        self.before = (stepper.time(), stepper.states().to_vec());
        if let Some(index) = crossed {
            let mut rates = vec![0.0; before.1.len()];
            self.flow.rates(before.0, &before.1, &mut rates);
            let now = stepper.time();
            self.correct(stepper, now, index, &rates);
        }
    }

    /// Continues after a jump that the run has reached.
    pub fn cross(&mut self, stepper: &mut dyn Stepper, after: f64, index: usize) {
        if self.fixed[index] {
            return self.restart(stepper, after);
        }
        let mut rates = vec![0.0; stepper.states().len()];
        self.flow.rates(stepper.time(), stepper.states(), &mut rates);
        self.correct(stepper, after, index, &rates);
    }

    /// Continues at `after` with the states and sensitivities that the run has.
    fn restart(&mut self, stepper: &mut dyn Stepper, after: f64) {
        let n = stepper.states().len();
        self.values[..n].copy_from_slice(stepper.states());
        stepper.sensitivities(&mut self.values[n..]);
        self.flow.all(after, &self.values, &mut self.rates);
        let ((_, sensitivities), (rates, their_rates)) =
            (self.values.split_at(n), self.rates.split_at(n));
        stepper.go_on(after, rates, sensitivities, their_rates);
    }

    /// Corrects the sensitivities for a jump from `old_rates`, and continues at `after`.
    fn correct(&self, stepper: &mut dyn Stepper, after: f64, index: usize, old_rates: &[f64]) {
        let (flow, now) = (self.flow, stepper.time());
        let states = stepper.states().to_vec();
        let n = states.len();
        let mut rates = vec![0.0; n];
        flow.rates(after, &states, &mut rates);
        let mut sensitivities = vec![0.0; n * flow.channels()];
        stepper.sensitivities(&mut sensitivities);
        let mut quantity = Quantity::new(&flow.system.breaks[index].quantity);
        let point = flow.point(now, &states);
        let first = point.len() - n;
        let mut direction = vec![0.0; point.len()];
        direction[0] = 1.0;
        direction[first..].copy_from_slice(old_rates);
        let speed = quantity.slope(&point, &direction);
        for (channel, sensitivity) in sensitivities.chunks_mut(n).enumerate() {
            direction.fill(0.0);
            direction[flow.coordinate(channel)] = 1.0;
            direction[first..].copy_from_slice(sensitivity);
            let later = -quantity.slope(&point, &direction) / speed;
            if later.is_finite() {
                for ((s, old), new) in sensitivity.iter_mut().zip(old_rates).zip(&rates) {
                    *s += (old - new) * later;
                }
            }
        }
        let mut their_rates = vec![0.0; sensitivities.len()];
        let both = sensitivities.chunks(n).zip(their_rates.chunks_mut(n));
        for (channel, (sensitivity, rate)) in both.enumerate() {
            flow.sensitivity_rate(after, &states, channel, sensitivity, rate);
        }
        stepper.go_on(after, &rates, &sensitivities, &their_rates);
    }
}

/// Returns true if neither states nor inputs move the jumps of a break.
fn is_fixed(broken: &Break, flow: &Flow<'_>) -> bool {
    let by_input = |channel| broken.quantity.depends_on(flow.coordinate(channel));
    !depends_on_states(broken, flow) && !(0..flow.channels()).any(by_input)
}

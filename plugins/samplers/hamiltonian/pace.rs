//! Step size of the leapfrog integrator.

use rand::Rng;
use serde::{Deserialize, Serialize};

use super::leapfrog::{Flow, Point};

/// Dual averaging (Nesterov) of the logarithm of the step size towards a target acceptance rate (Hoffman and Gelman
/// 2014, section 3.2, with the constants of their algorithm 6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pace {
    /// Current step size.
    pub step: f64,
    /// Logarithm `mu` towards which the iterates are drawn: ten times the first step size, because large steps are
    /// cheap to try.
    centre: f64,
    /// Average of the logarithm of the step size over the steps.
    average: f64,
    /// Averaged difference between target and actual acceptance.
    lack: f64,
    count: u32,
}

const GAMMA: f64 = 0.05;
const T0: f64 = 10.0;
const KAPPA: f64 = 0.75;

impl Pace {
    /// Finds an initial step size at which one leapfrog step is accepted with a probability near `target` (algorithm
    /// 4), and returns the number of gradients it took.
    pub fn find(flow: &Flow<'_>, point: &Point, target: f64, rng: &mut impl Rng) -> (Self, u64) {
        // The search is limited to 1e-12 .. 1e4: beyond, the function is not a density.
        const LONGEST: f64 = 16_384.0;
        const SHORTEST: f64 = 1e-12;
        let (mut step, mut gradients) = (1.0, 0);
        let mut grow = None;
        loop {
            let mut phase = flow.push(point, rng);
            let energy = phase.energy();
            flow.leapfrog(&mut phase, step);
            gradients += 1;
            // A NaN energy compares false and counts as rejected.
            let good = energy - phase.energy() > target.ln();
            if *grow.get_or_insert(good) != good || !(SHORTEST..LONGEST).contains(&step) {
                break;
            }
            step *= if good { 2.0 } else { 0.5 };
        }
        let centre = (10.0 * step).ln();
        (Self { step, centre, average: step.ln(), lack: 0.0, count: 0 }, gradients)
    }

    /// Updates the step size from the acceptance statistic of one step.
    pub fn learn(&mut self, acceptance: f64, target: f64) {
        self.count += 1;
        let t = f64::from(self.count);
        let weight = 1.0 / (t + T0);
        self.lack += weight * (target - acceptance - self.lack);
        let step = self.centre - t.sqrt() / GAMMA * self.lack;
        self.average += t.powf(-KAPPA) * (step - self.average);
        self.step = step.exp();
    }

    /// Fixes the step size at the average, at the end of the warm-up.
    pub fn settle(&mut self) {
        self.step = self.average.exp();
    }
}

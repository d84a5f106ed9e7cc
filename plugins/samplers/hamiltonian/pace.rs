//! The size of the leapfrog steps.

use rand::Rng;
use serde::{Deserialize, Serialize};

use super::leapfrog::{Flow, Point};

/// Nesterov's dual averaging of the logarithm of a step size towards a given acceptance (Hoffman and Gelman 2014,
/// section 3.2, with the constants of their algorithm 6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pace {
    /// The step size to be used now.
    pub step: f64,
    /// Where the search begins, ten times the first step size: large steps are cheap to try.
    centre: f64,
    /// The logarithm of the step size averaged over the steps.
    average: f64,
    /// The averaged lack of acceptance.
    lack: f64,
    count: u32,
}

const GAMMA: f64 = 0.05;
const T0: f64 = 10.0;
const KAPPA: f64 = 0.75;

impl Pace {
    /// A first step size, with which one leapfrog step is accepted with a chance near `target`
    /// (algorithm 4), and the number of gradients that it took to find.
    pub fn find(flow: &Flow<'_>, point: &Point, target: f64, rng: &mut impl Rng) -> (Self, u64) {
        // Powers of two between 1e-12 and 1e4: a target beyond is no density.
        const LONGEST: f64 = 16_384.0;
        const SHORTEST: f64 = 1e-12;
        let (mut step, mut gradients) = (1.0, 0);
        let mut grow = None;
        loop {
            let mut phase = flow.push(point, rng);
            let energy = phase.energy();
            flow.leapfrog(&mut phase, step);
            gradients += 1;
            // An energy that is not a number is no acceptance.
            let good = energy - phase.energy() > target.ln();
            if *grow.get_or_insert(good) != good || !(SHORTEST..LONGEST).contains(&step) {
                break;
            }
            step *= if good { 2.0 } else { 0.5 };
        }
        let centre = (10.0 * step).ln();
        (Self { step, centre, average: step.ln(), lack: 0.0, count: 0 }, gradients)
    }

    /// Takes in the acceptance of one step.
    pub fn learn(&mut self, acceptance: f64, target: f64) {
        self.count += 1;
        let t = f64::from(self.count);
        let weight = 1.0 / (t + T0);
        self.lack += weight * (target - acceptance - self.lack);
        let step = self.centre - t.sqrt() / GAMMA * self.lack;
        self.average += t.powf(-KAPPA) * (step - self.average);
        self.step = step.exp();
    }

    /// Ends the search with the average.
    pub fn settle(&mut self) {
        self.step = self.average.exp();
    }
}

//! Small systems with their parameters and the physics that their models may lack.

use std::f64::consts::TAU;

use super::law::Law;
use crate::noise::Source;

/// Kind of a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A pendulum released from rest; its angle.
    Pendulum,
    /// A mass driven by a known motor, with linear damping; its position.
    Drive,
    /// A body that cools in surroundings of a known temperature; its temperature.
    Cooling,
    /// Two tanks in a cascade with a pump; the level of the upper one.
    Tanks,
    /// A falling body; its height.
    Fall,
    /// A mass on a spring with damping, driven below its resonance; its position.
    Driven,
    /// The same without a drive, released from rest.
    Free,
}

/// A parameter of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Middle.
    pub middle: f64,
    /// Standard deviation relative to the middle, or, if the middle is zero, itself.
    pub relative: f64,
}

impl Parameter {
    /// Standard deviation.
    pub fn width(self) -> f64 {
        self.relative * if self.middle == 0.0 { 1.0 } else { self.middle.abs() }
    }

    /// Returns true if it is nearly known beforehand.
    pub fn is_known(self) -> bool {
        self.middle != 0.0 && self.relative < 0.01
    }

    /// A true value.
    pub fn drawn(self, random: &mut Source) -> f64 {
        self.middle + self.width() * random.normal().clamp(-1.5, 1.5)
    }
}

/// A system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct System {
    /// Kind.
    pub kind: Kind,
}

/// Frequency of the drives, 1/s.
pub const DRIVE: f64 = 0.3;

/// Temperature of the surroundings, K.
pub const AROUND: f64 = 293.0;

/// Excess temperature that counts as one in the laws, K.
pub const EXCESS: f64 = 40.0;

const fn p(name: &'static str, unit: &'static str, middle: f64, relative: f64) -> Parameter {
    Parameter { name, unit, middle, relative }
}

impl System {
    /// All systems.
    pub fn all() -> [Self; 7] {
        [
            Kind::Pendulum,
            Kind::Drive,
            Kind::Cooling,
            Kind::Tanks,
            Kind::Fall,
            Kind::Driven,
            Kind::Free,
        ]
        .map(|kind| Self { kind })
    }

    /// Parameters in the order of a point.
    pub fn parameters(self) -> Vec<Parameter> {
        let oscillator = [p("stiffness", "1/s2", 9.0, 0.1), p("damping", "1/s", 0.25, 0.3)];
        match self.kind {
            Kind::Pendulum => vec![
                p("stiffness", "1/s2", 9.0, 0.1),
                p("damping", "1/s", 0.08, 0.3),
                p("release", "", 0.8, 0.1),
            ],
            Kind::Drive => vec![p("force", "m/s2", 1.5, 0.2), p("damping", "1/s", 0.9, 0.3)],
            Kind::Cooling => vec![p("loss", "1/s", 0.01, 0.2), p("begin", "K", 360.0, 0.02)],
            Kind::Tanks => vec![
                p("outlet", "1/s", 0.5, 0.2),
                p("pump", "1/s", 0.6, 0.2),
                p("begin", "", 1.0, 0.1),
            ],
            Kind::Fall => vec![
                p("gravity", "m/s2", 9.81, 0.001),
                p("height", "m", 47.0, 0.05),
                p("velocity", "m/s", 0.0, 1.0),
            ],
            Kind::Driven => {
                [&oscillator[..], &[p("force", "m/s2", 4.0, 0.1), p("begin", "m", 0.5, 0.1)]]
                    .concat()
            }
            Kind::Free => [&oscillator[..], &[p("begin", "m", 1.0, 0.1)]].concat(),
        }
    }

    /// Times of this many values.
    pub fn times(self, count: usize) -> Vec<f64> {
        let last = match self.kind {
            Kind::Pendulum => 20.0,
            Kind::Drive => 10.0,
            Kind::Cooling => 300.0,
            Kind::Tanks => 30.0,
            Kind::Fall => 2.8,
            Kind::Driven | Kind::Free => 15.0,
        };
        (1..=count).map(|i| last * i as f64 / count as f64).collect()
    }

    /// The rate of the states by the model alone.
    fn model(self, p: &[f64], t: f64, [x, v, _]: [f64; 3]) -> [f64; 3] {
        match self.kind {
            Kind::Pendulum => [v, -p[0] * x.sin() - p[1] * v, 0.0],
            Kind::Drive => [v, p[0] * (TAU * DRIVE * t).sin() - p[1] * v, 0.0],
            Kind::Cooling => [-p[0] * (x - AROUND), 0.0, 0.0],
            Kind::Tanks => {
                let pump = 1.0 + 0.5 * (TAU * t / 13.0).sin();
                [
                    p[1] * pump - p[0] * x.max(0.0).sqrt(),
                    p[0] * (x.max(0.0).sqrt() - v.max(0.0).sqrt()),
                    0.0,
                ]
            }
            Kind::Fall => [v, -p[0], 0.0],
            Kind::Driven => [v, p[2] * (TAU * DRIVE * t).cos() - p[1] * v - p[0] * x, 0.0],
            Kind::Free => [v, -p[1] * v - p[0] * x, 0.0],
        }
    }

    /// The state at the beginning.
    fn begin(self, p: &[f64]) -> [f64; 3] {
        match self.kind {
            Kind::Drive => [0.0; 3],
            Kind::Cooling => [p[1], 0.0, 0.0],
            Kind::Tanks => [p[2], 0.8, 0.0],
            Kind::Fall => [p[1], p[2], 0.0],
            Kind::Driven => [p[3], 0.0, 0.0],
            Kind::Pendulum | Kind::Free => [p[2], 0.0, 0.0],
        }
    }

    /// The state whose rate lacks something.
    fn site(self) -> usize {
        usize::from(!matches!(self.kind, Kind::Cooling | Kind::Tanks))
    }

    /// The quantity `u` of the laws: the state of the site, above the surroundings for a temperature.
    fn quantity(self, state: [f64; 3]) -> f64 {
        let own = state[self.site()];
        if self.kind == Kind::Cooling { own - AROUND } else { own }
    }

    /// The sizes of `u`, of the position and of the site's rate: root mean squares along the run of the model alone,
    /// except for an excess temperature.
    pub(super) fn sizes(self, p: &[f64], times: &[f64]) -> [f64; 3] {
        let states = self.states(p, &[], [1.0; 2], times, super::FINE);
        let mut sums = [0.0; 3];
        for (state, t) in states.iter().zip(times) {
            let rate = self.model(p, *t, *state)[self.site()];
            for (sum, x) in sums.iter_mut().zip([self.quantity(*state), state[0], rate]) {
                *sum += x * x / times.len() as f64;
            }
        }
        let [u, place, rate] = sums.map(f64::sqrt);
        [if self.kind == Kind::Cooling { EXCESS } else { u }, place, rate]
    }

    /// The coefficient of a law at which it is as large as the site's rate, where `u` and the position have their
    /// root mean squares.
    pub fn scale(self, law: Law, p: &[f64], times: &[f64]) -> f64 {
        let rate = self.sizes(p, times)[2];
        let one = match law {
            Law::Cogging | Law::Hysteresis | Law::DeadZone | Law::Stop | Law::Overflow => 1.0,
            _ => law.rate(1.0, 1.0, 1.0).abs(),
        };
        rate / one
    }

    /// The observed quantity at some times, with laws and their coefficients added to the rate of the site.
    pub fn solution(self, p: &[f64], laws: &[(Law, f64)], times: &[f64], fine: usize) -> Vec<f64> {
        let [u, x, _] = self.sizes(p, times);
        self.states(p, laws, [u, x], times, fine).into_iter().map(|state| state[0]).collect()
    }

    fn states(
        self,
        p: &[f64],
        laws: &[(Law, f64)],
        [size, place]: [f64; 2],
        times: &[f64],
        fine: usize,
    ) -> Vec<[f64; 3]> {
        let site = self.site();
        let rates = |t: f64, state: [f64; 3]| {
            let mut rates = self.model(p, t, state);
            let (u, x) = (self.quantity(state) / size, state[0] / place);
            for (law, coefficient) in laws {
                rates[site] += coefficient * law.rate(u, x, state[2]);
                rates[2] += law.internal(state[1] / place, state[2]);
            }
            rates
        };
        let along = |s: [f64; 3], k: [f64; 3], h: f64| [0, 1, 2].map(|i| s[i] + h * k[i]);
        let (mut t, mut state) = (0.0, self.begin(p));
        // Dry friction is stiff where the speed passes through zero: at least so many steps over the whole run.
        let fine = fine.max(12_000usize.div_ceil(times.len()));
        let mut all = Vec::with_capacity(times.len());
        for &next in times {
            let h = (next - t) / fine as f64;
            for step in 0..fine {
                let at = t + h * step as f64;
                let k1 = rates(at, state);
                let k2 = rates(at + 0.5 * h, along(state, k1, 0.5 * h));
                let k3 = rates(at + 0.5 * h, along(state, k2, 0.5 * h));
                let k4 = rates(at + h, along(state, k3, h));
                for i in 0..3 {
                    state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
                }
            }
            t = next;
            all.push(state);
        }
        all
    }
}

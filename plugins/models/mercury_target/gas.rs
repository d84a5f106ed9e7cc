//! Mercury with gas bubbles: an equation of state with the volume of the gas in each cell.
//!
//! The strain of a cell is that of the liquid plus the change of the gas volume fraction, `ε = ε_l + a - a₀`, and
//! `p = max(p₀ - K ε_l, -p_c)`. With `w = a/a₀` and the gas at `p_g = P w^-κ` (`P` the ambient pressure, `κ` the
//! polytropic index) the gas obeys `κ P τ w' = p_g - (p + P)`. With `τ = 0` the gas is always in equilibrium; with
//! `τ > 0` the bubbles are over-damped and have the relaxation time `τ`. Small changes obey
//! `τ δ' + δ = -a₀ (p - p_s)/(κP)`, so that long waves propagate at Wood's speed, `1/ρc_m² = 1/ρc² + a₀/κP`. The mass of
//! the gas is neglected.
//!
//! The step is implicit. In the unknown `w` both sides are monotone, hence the root is unique, and the relaxation
//! only dissipates energy.

use super::SimulationError;
use super::eos::{EquationOfState, TensileCutoff};
use super::settings::{Geometry, check};

/// Relative change below which the iteration ends; the remaining error is about its cube.
const CLOSE: f64 = 5e-3;

/// Relative change below which the iteration takes steps of third order.
const NEAR: f64 = 0.1;

/// Limit on the number of iterations, far above the number that any case needs.
const MOST_ROUNDS: usize = 200;

/// The gas in the vessel at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gas {
    /// Volume fraction of the gas, mean over a cross section far behind the window; in [0, 1).
    pub void_fraction: f64,
    /// Stratification over the radius `a` of the vessel, in [-1, 1]: the volume fraction varies as
    /// `1 + gradient (2r²/a² - 1)`, with the same mean over the cross section.
    pub gradient: f64,
    /// Fraction of the gas that is missing at the window, in [0, 1].
    pub depletion: f64,
    /// Length behind the window over which the missing fraction decays to 1/e, m.
    pub depletion_length: f64,
    /// Radius of the bubbles, m; 0 for gas that is always in equilibrium.
    pub bubble_radius: f64,
    /// Static pressure, Pa.
    pub ambient_pressure: f64,
    /// Polytropic index of the gas: 1 for isothermal changes, 5/3 for adiabatic helium.
    pub polytropic_index: f64,
}

impl Default for Gas {
    fn default() -> Self {
        Self {
            void_fraction: 2e-4,
            gradient: 0.0,
            depletion: 0.0,
            depletion_length: 0.05,
            bubble_radius: 5e-5,
            ambient_pressure: 3e5,
            polytropic_index: 1.4,
        }
    }
}

impl Gas {
    pub(super) fn validate(&self) -> Result<(), SimulationError> {
        let zero_or_more = |x: f64| x >= 0.0;
        let positive = |x: f64| x > 0.0;
        check("void_fraction", self.void_fraction, |x| (0.0..1.0).contains(&x), "in [0, 1)")?;
        check("void_gradient", self.gradient, |x| x.abs() <= 1.0, "in [-1, 1]")?;
        check("void_depletion", self.depletion, |x| (0.0..=1.0).contains(&x), "in [0, 1]")?;
        check("depletion_length", self.depletion_length, positive, "a positive number")?;
        check("bubble_radius", self.bubble_radius, zero_or_more, "zero or more")?;
        check("ambient_pressure", self.ambient_pressure, positive, "a positive number")?;
        check("polytropic_index", self.polytropic_index, |x| x >= 1.0, "at least 1")
    }

    /// Gas volume fraction at rest at (r, z), with coordinates in m.
    pub fn share(&self, geometry: &Geometry, r: f64, z: f64) -> f64 {
        let depth = (z - geometry.nose(r)).max(0.0);
        let across = 1.0 + self.gradient * (2.0 * (r / geometry.radius).powi(2) - 1.0);
        let along = 1.0 - self.depletion * (-depth / self.depletion_length).exp();
        self.void_fraction * across * along
    }

    /// The bubbles in a liquid of the given density, kg/m³. Their relaxation time is `1/2πf₀` with the resonance
    /// frequency `f₀` of Minnaert (Phil. Mag. 16, 1933, 235), that is `R √(ρ/3κP)`: the inertia of the liquid permits
    /// no faster response.
    pub fn bubbles(&self, density: f64) -> Bubbles {
        let Self { ambient_pressure, polytropic_index, bubble_radius, .. } = *self;
        let stiffness = 3.0 * polytropic_index * ambient_pressure;
        Bubbles {
            ambient_pressure,
            polytropic_index,
            relaxation: bubble_radius * (density / stiffness).sqrt(),
        }
    }
}

/// Response of bubbles to pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bubbles {
    /// Pressure `P` of the gas at rest, Pa.
    pub ambient_pressure: f64,
    /// Polytropic index `κ`.
    pub polytropic_index: f64,
    /// Relaxation time `τ` of small changes, s; 0 for gas that is always in equilibrium.
    pub relaxation: f64,
}

/// A liquid with bubbles.
#[derive(Debug, Clone)]
pub struct Bubbly {
    liquid: TensileCutoff,
    bubbles: Bubbles,
    /// `1/κ`.
    inverse_index: f64,
    /// Ratio of each term of the binomial series of the power `-1/κ` to the previous term.
    ratios: [f64; 5],
    /// Gas volume fraction at rest in each cell.
    share: Vec<f64>,
    /// Volume and pressure of the gas in each cell.
    gas: Vec<State>,
    /// Work done on the gas of each cell so far, J/m³.
    work: Vec<f64>,
}

/// Gas of a cell relative to its state at rest.
#[derive(Debug, Clone, Copy)]
struct State {
    /// Relative volume `w`.
    volume: f64,
    /// Relative pressure `w^-κ`.
    pressure: f64,
}

/// Conditions that the liquid sets for the gas of a cell in one step.
#[derive(Debug, Clone, Copy)]
struct Surroundings {
    /// Pressure of the liquid with the gas at its volume at rest, Pa.
    trial: f64,
    /// `K a₀`: increase of the liquid's pressure per relative volume of the gas, Pa.
    stiffness: f64,
    /// `κ P τ / dt`, Pa.
    resistance: f64,
    /// Lowest pressure of the liquid, Pa.
    floor: f64,
}

impl Bubbly {
    /// The law for cells with the given gas volume fractions at rest.
    pub fn new(liquid: TensileCutoff, bubbles: Bubbles, share: Vec<f64>) -> Self {
        let rest = State { volume: 1.0, pressure: 1.0 };
        let (gas, work) = (vec![rest; share.len()], vec![0.0; share.len()]);
        let inverse_index = 1.0 / bubbles.polytropic_index;
        let ratios = [0.0, 1.0, 2.0, 3.0, 4.0].map(|k| -(inverse_index + k) / (k + 1.0));
        Self { liquid, bubbles, inverse_index, ratios, share, gas, work }
    }

    /// The gas after a step, and the stiffness of the mixture divided by that of the liquid, `K` (where the liquid is
    /// not cavitated).
    ///
    /// Solves `κPτ/dt (w - w_old) + p(w) + P (1 - w^-κ) = 0` by Newton's method. As a function of the gas pressure
    /// `w^-κ` the left side is convex; as a function of `w` it is concave on each side of the cutoff. Long steps of
    /// compression therefore use the first variable and long steps of expansion the second, so that no iterate
    /// becomes negative or passes the root twice. Short steps are Halley's.
    fn follow(&self, old: State, around: &Surroundings) -> (State, f64) {
        let Bubbles { ambient_pressure: ambient, polytropic_index: index, .. } = self.bubbles;
        let Surroundings { trial, stiffness, resistance, floor } = *around;
        let mut now = old;
        for _ in 0..MOST_ROUNDS {
            let State { volume, pressure } = now;
            let liquid = trial + stiffness * (volume - 1.0);
            let (held, slope) = if liquid < floor { (floor, 0.0) } else { (liquid, stiffness) };
            let excess = resistance * (volume - old.volume) + held + ambient * (1.0 - pressure);
            // All slopes here are multiplied by the volume.
            let own = resistance * volume + index * ambient * pressure;
            let inverse = 1.0 / (own + slope * volume);
            let change = excess * inverse;
            if change.abs() < NEAR {
                let linear = 1.0 - index * ambient * pressure * inverse;
                let bend = 0.5 * (1.0 + index) * linear * change;
                let grown = index * change * (1.0 + bend + bend * bend);
                now.pressure *= 1.0 + grown;
                if change.abs() < CLOSE {
                    now.volume *= self.volume_ratio(grown);
                    return (now, own * inverse);
                }
                now.volume = now.pressure.powf(-self.inverse_index);
            } else if change > 0.0 {
                now.pressure *= 1.0 + index * change;
                now.volume = now.pressure.powf(-self.inverse_index);
            } else {
                // Beyond the kink the liquid adds stiffness. The factor prevents that rounding leaves the iterate
                // below it.
                let kink = if liquid < floor { (floor - trial) / stiffness } else { f64::INFINITY };
                now.volume = (volume * (1.0 - change)).min((1.0 + kink) * (1.0 + 1e-9));
                now.pressure = now.volume.powf(-index);
            }
        }
        (now, 0.0)
    }

    /// `(1 + grown)^(-1/κ)` up to the fifth power.
    fn volume_ratio(&self, grown: f64) -> f64 {
        self.ratios.iter().rev().fold(1.0, |sum, ratio| 1.0 + ratio * grown * sum)
    }

    /// Energy of the gas of a cell, J/m³: `P a₀ ((w^(1-κ) - 1)/(κ - 1) + w - 1)`, the work done on it minus that of
    /// the ambient pressure.
    fn gas_energy(&self, cell: usize) -> f64 {
        let Bubbles { ambient_pressure, polytropic_index, .. } = self.bubbles;
        let volume = self.gas[cell].volume;
        let (expansion, above) = (volume.ln(), polytropic_index - 1.0);
        let compressed =
            if above == 0.0 { -expansion } else { (-above * expansion).exp_m1() / above };
        ambient_pressure * self.share[cell] * (compressed + volume - 1.0)
    }
}

impl EquationOfState for Bubbly {
    fn update(
        &mut self,
        first: usize,
        strain: &[f64],
        dt: f64,
        pressure: &mut [f64],
        speed: &mut [f64],
    ) {
        let Bubbles { ambient_pressure, polytropic_index, relaxation } = self.bubbles;
        let (modulus, floor) = (self.liquid.bulk_modulus(), self.liquid.floor());
        let resistance = polytropic_index * ambient_pressure * relaxation / dt;
        for (i, &strain) in strain.iter().enumerate() {
            let cell = first + i;
            let trial = self.liquid.trial(cell, strain);
            let share = self.share[cell];
            let (mut liquid, mut stiffness) = (trial, 1.0);
            // At the moment of the pulse the gas is at rest.
            if share > 0.0 && dt > 0.0 {
                let around = Surroundings { trial, stiffness: modulus * share, resistance, floor };
                let old = self.gas[cell];
                let (new, left) = self.follow(old, &around);
                liquid = trial + around.stiffness * (new.volume - 1.0);
                // At constant strain the pressure of the liquid is linear in the gas volume.
                let mean = 0.5 * (pressure[i] + liquid.max(floor));
                self.work[cell] -= mean * share * (new.volume - old.volume);
                self.gas[cell] = new;
                stiffness = left;
            }
            let cavitated = liquid < floor;
            pressure[i] = if cavitated { floor } else { liquid };
            speed[i] = if cavitated { 0.0 } else { stiffness.sqrt() };
        }
    }

    fn sound_speed(&self) -> f64 {
        self.liquid.sound_speed()
    }

    /// Energy of the liquid and of the gas.
    fn stored_energy(&self, cell: usize, strain: f64) -> f64 {
        let change = self.share[cell] * (self.gas[cell].volume - 1.0);
        self.liquid.stored_energy(cell, strain - change) + self.gas_energy(cell)
    }

    /// Work done on the gas that the gas does not store. In equilibrium this is the loss in the sudden collapse at
    /// the pulse; otherwise it includes the work against the resistance.
    fn lost_energy(&self, cell: usize) -> f64 {
        self.work[cell] - self.gas_energy(cell)
    }
}

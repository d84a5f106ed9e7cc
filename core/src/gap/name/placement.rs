//! Prior masses: every type of effect the same, divided among the places where it may act.

use statrs::function::factorial::ln_binomial;

use crate::plugin::effect::Reach;

/// The log prior mass of a place within a type of effect: a third each for all sensors, one sensor, and a
/// group between, whose sizes are alike and whose members are any.
pub fn log_prior(reach: Reach, chosen: Option<usize>, sensors: usize) -> f64 {
    let Some(chosen) = chosen.filter(|_| sensors >= 2) else {
        return if reach == Reach::Any && sensors >= 2 { -(3.0_f64.ln()) } else { 0.0 };
    };
    let sets = ln_binomial(sensors as u64, chosen as u64);
    match reach {
        Reach::Single => -sets,
        Reach::Any | Reach::Whole if chosen == 1 => -(3.0_f64.ln()) - sets,
        Reach::Any | Reach::Whole => -(3.0_f64.ln()) - ((sensors.max(4) - 2) as f64).ln() - sets,
    }
}

//! Effects: named pieces of missing physics that act on the model's response.

pub mod clock_rate;
pub mod common;
pub mod crosstalk;
pub mod damping;
pub mod delay;
pub mod drift;
pub mod echo;
pub mod expression;
pub mod flash;
pub mod gain;
pub mod gas_attenuation;
pub mod gauge_length;
pub mod level_jumps;
pub mod low_pass;
pub mod misalignment;
pub mod misplacement;
pub mod offset;
pub mod pulse_heating;
pub mod resonance;
pub mod saturation;
pub mod secondary_pulse;
pub mod time_warp;
pub mod timing_jitter;

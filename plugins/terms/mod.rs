//! Terms: named pieces of physics that the equations of a model may lack.

pub mod ageing;
pub mod bouc_wen;
pub mod common;
pub mod constant_rate;
pub mod convection;
pub mod coulomb_friction;
pub mod cubic_stiffness;
pub mod dahl_friction;
pub mod dead_zone;
pub mod delayed;
pub mod evaporation;
pub mod expression;
pub mod forcing;
pub mod fractional_damping;
pub mod limiter;
pub mod linear_friction;
pub mod maxwell_damping;
pub mod overflow;
pub mod power_friction;
pub mod power_stiffness;
pub mod pull;
pub mod quadratic_friction;
pub mod quadratic_stiffness;
pub mod radiation;
pub mod relaxation;
pub mod stribeck_friction;

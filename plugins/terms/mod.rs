//! Terms: named pieces of physics that the equations of a model may lack.

pub mod common;
pub mod constant_rate;
pub mod coulomb_friction;
pub mod cubic_stiffness;
pub mod delayed;
pub mod evaporation;
pub mod expression;
pub mod forcing;
pub mod linear_friction;
pub mod overflow;
pub mod pull;
pub mod quadratic_friction;
pub mod quadratic_stiffness;
pub mod radiation;
pub mod relaxation;

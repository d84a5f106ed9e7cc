//! From a latent force to a law: what a rate of the model's equations lacks over time, and as a function of the states.
//!
//! Where no candidate explains the gap, the missing rate `u(t)` of a state is inferred as a Gauss-Markov process inside
//! the equations (a latent force: Alvarez, Luengo and Lawrence, IEEE Transactions on Pattern Analysis and Machine
//! Intelligence 35 (2013) 2693; Hartikainen and Särkkä, UAI 2012). The response is linearised about the trajectory, with
//! the sensitivities of the equations themselves, and the process is integrated over the calibrated unknowns
//! (`force`).
//!
//! The law is then sought among functions of the states along that trajectory (`forms`). They are not compared with
//! the force point by point, whose errors are correlated and depend on its prior: the response to each form along the
//! trajectory is compared with the data in the metric of the noise, off the slopes of the unknowns (`choose`), as the
//! weak form of sparse regression does with integrals (Messenger and Bortz, Multiscale Modeling and Simulation 19 (2021)
//! 1474). The best forms are refitted non-linearly with their exponents and thresholds (`trial`), and a further term
//! must be worth its price. The share of random halves of the data in which the same form is chosen is stated
//! (Meinshausen and Bühlmann, Journal of the Royal Statistical Society B 72 (2010) 417).
//!
//! A law is a law only if it predicts a condition or blocks that were used neither to choose nor to fit it ([`apart`]).

mod along;
pub mod apart;
mod choose;
mod find;
mod finder;
mod force;
mod forms;
mod grow;
mod model;
mod posterior;
mod quantity;
mod shown;
mod sites;
mod term;
mod trial;

pub use find::{Described, find};
pub use finder::LawSetting;
pub use term::pieces;

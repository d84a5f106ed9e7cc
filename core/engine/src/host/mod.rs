//! The side of the program: the traits of the kinds, implemented by calling the tables of a library.
//!
//! Every answer is checked for its size, and for numbers where the trait promises numbers. What is wrong is an error
//! that names library and plugin where the trait has room for one, else the plugin has a fault.
#![allow(
    unsafe_code,
    reason = "the boundary to other people's code; each use says why it is sound"
)]

pub mod declared;
mod design;
mod discrepancy;
mod effect;
pub mod library;
mod model;
mod offer;
mod plugin;
mod quantity;
mod reader;
pub mod recorded;
mod sampler;
mod surrogate;
mod target;

pub use offer::offers;
pub use plugin::Plugin;

//! Plugins in Python files: the traits of the kinds, implemented by messages to worker processes.
//!
//! A worker has loaded the user's file and makes the objects that a request names; any worker can make any object, so that
//! threads do not wait for each other and a worker that has ended is replaced. Its Python side is in the folder `python`.
//! Answers are checked as those of libraries are: what is wrong is an error that names plugin and file.

mod discrepancy;
mod effect;
mod load;
mod message;
mod model;
mod object;
mod offer;
mod quantity;
mod reader;
mod sampler;
mod script;
mod surrogate;
mod worker;
mod written;

pub use load::load;
pub use written::record;

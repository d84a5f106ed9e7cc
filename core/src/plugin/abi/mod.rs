//! Plugins in libraries that are loaded while the program runs.
//!
//! [`table`] is what crosses the boundary, laid out as C does; `docs/abi.md` describes it. [`guest`] makes its tables
//! from types that implement the traits of the kinds, [`host`] implements the traits by calling the tables, and
//! [`library`] loads. Both sides live here, so that one folder defines the boundary and both can be tested without
//! a library.
#![allow(
    unsafe_code,
    reason = "the boundary to other people's code; each use says why it is sound"
)]

pub mod declared;
mod guard;
pub mod guest;
pub mod header;
pub mod host;
pub mod library;
mod linear;
mod memo;
pub mod record;
mod refusal;
mod reply;
pub mod table;
pub mod wire;

pub use library::Library;
use memo::Memo;
pub use refusal::Refusal;
pub use reply::Reply;

//! Plugins in libraries that are loaded while the program runs.
//!
//! [`table`] is what crosses the boundary, laid out as C does, and [`wire`] what goes through it as JSON; `docs/abi.md`
//! describes both. A table of functions is declared once; from it follow the C header, the trait of those who serve such
//! objects, and the calls of an [`Object`] of the other side. The side of the library serves types that implement the
//! traits of the kinds: it is `lacuna-plugin`. The side of the program implements the traits by calls: it is the module
//! `host` of the engine, which also loads libraries.
#![allow(
    unsafe_code,
    reason = "the boundary to other people's code; each use says why it is sound"
)]

#[macro_use]
mod shape;

pub mod argument;
mod basic;
pub mod check;
pub mod guard;
pub mod header;
#[doc(hidden)]
pub mod hostile;
pub mod linear;
pub mod memo;
pub mod object;
pub mod offered;
pub mod options;
pub mod record;
pub mod refusal;
pub mod reply;
pub mod status;
pub mod table;
pub mod watch;
pub mod wire;

pub use memo::Memo;
pub use object::Object;
pub use refusal::Refusal;
pub use reply::Reply;

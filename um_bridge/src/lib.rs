//! UM-Bridge, the protocol by which a model in any language answers an uncertainty quantification program in any
//! other: version 1.0, client and server.
//!
//! A model is a function from some vectors to some vectors, with derivatives where it has them. All questions and
//! answers are JSON over HTTP. Source: Seelinger, Cheng-Seelinger, Davis, Parno and Reinarz, UM-Bridge: Uncertainty
//! quantification and modeling bridge, Journal of Open Source Software 8 (2023) 4748; the reference
//! implementation is the Python package `umbridge`.
//!
//! This crate knows nothing of studies: the plugin `um_bridge` puts a study on the client, `lacuna serve` on the server.

pub mod client;
pub mod protocol;
pub mod server;

pub use client::Client;
pub use server::{Model, Server};

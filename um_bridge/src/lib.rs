//! UM-Bridge, a protocol through which uncertainty quantification programs call models written in any language: version
//! 1.0, client and server.
//!
//! A model is a function from vectors to vectors, with optional derivatives. All requests and responses are JSON over
//! HTTP. Source: Seelinger, Cheng-Seelinger, Davis, Parno and Reinarz, UM-Bridge: Uncertainty quantification and
//! modeling bridge, Journal of Open Source Software 8 (2023) 4748; the reference implementation is the Python package
//! `umbridge`.
//!
//! This crate does not depend on studies: the plugin `um_bridge` uses the client for a study's model, `lacuna serve`
//! uses the server, and `lacuna view` the HTTP below it.

pub mod client;
pub mod http;
pub mod protocol;
pub mod server;

pub use client::Client;
pub use server::{Model, Server};

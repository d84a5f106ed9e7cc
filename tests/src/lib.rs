//! Empty library; the integration tests are in `main.rs` and `contracts.rs`.

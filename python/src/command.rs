//! The `lacuna` command.

use pyo3::prelude::*;

/// Runs the command with these arguments, of which the first is its name, and returns its exit code.
#[pyfunction]
pub fn command(py: Python<'_>, arguments: Vec<String>) -> u8 {
    py.detach(|| lacuna_cli::run(arguments.into_iter().map(Into::into)))
}

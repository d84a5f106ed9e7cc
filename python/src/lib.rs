//! The module `lacuna._engine`: what the Python package `lacuna` calls. Its functions take and return plain data; the
//! classes that users see are written in Python on top of them.

mod command;
mod functions;
mod observer;
mod problems;
mod stages;

// The plugins register themselves; naming their crate makes the linker include it.
use lacuna_plugins as _;
use pyo3::prelude::*;

/// Everything that the package needs of the engine.
#[pymodule]
mod _engine {
    #[pymodule_export]
    use crate::command::command;
    #[pymodule_export]
    use crate::functions::Functions;
    #[pymodule_export]
    use crate::problems::{RunError, StudyError, check};
    #[pymodule_export]
    use crate::stages::pursue;

    use super::{Bound, PyModule, PyModuleMethods as _, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

//! A plugin's page of the manual, made from the schema of its options.

use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator};

/// The generator whose schemas the manual and the editor's schema are made from.
pub(crate) fn generator() -> SchemaGenerator {
    SchemaSettings::draft2020_12().for_deserialize().into_generator()
}

/// A plugin's page.
#[derive(Clone, Debug, PartialEq)]
pub struct Manual {
    /// `surrogate.polynomial_chaos`
    pub name: String,
}

impl Manual {
    pub(crate) fn new(
        name: &str,
        _sections: &[&str],
        _plugin: &str,
        _schema: &Schema,
        _generator: &mut SchemaGenerator,
    ) -> Self {
        Self { name: name.to_owned() }
    }
}

//! The JSON Schema of the whole study language, every installed plugin included.

use serde_json::Value;

use super::file::{
    DesignKeys, DiscrepancyKeys, MeasurementKeys, ModelKeys, ParameterSection, ResponseSection,
    SamplerKeys, StudySection, SurrogateKeys, ValidateSection,
};
use super::schema::Language;
use crate::plugin::registry::NoKeys;
use crate::plugin::{Design, Discrepancy, Effect, Executor, Model, Reader, Sampler, Surrogate};

/// The schema, for editors that complete and check a study (`lacuna schema`).
pub fn schema() -> Value {
    let mut language = Language::new();
    language
        .table::<StudySection>("study")
        .required("study")
        .tables::<ParameterSection>("parameter")
        .required("parameter")
        .table::<ResponseSection>("response")
        .required("response")
        .section::<dyn Model, ModelKeys>("model")
        .section::<dyn Design, DesignKeys>("design")
        .section::<dyn Executor, NoKeys>("executor")
        .section::<dyn Reader, NoKeys>("simulations")
        .section::<dyn Reader, MeasurementKeys>("measurements")
        .section::<dyn Surrogate, SurrogateKeys>("surrogate")
        .section::<dyn Discrepancy, DiscrepancyKeys>("discrepancy")
        .sections::<dyn Effect, NoKeys>("effect")
        .section::<dyn Sampler, SamplerKeys>("sampler")
        .table::<ValidateSection>("validate");
    language.finish()
}

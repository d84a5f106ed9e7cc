//! The whole study language, every installed plugin included: as JSON Schema, and as a manual of the
//! engine's own keys.

use schemars::JsonSchema;
use serde_json::Value;

use super::file::{
    DerivedSection, DesignKeys, DiscrepancyKeys, EffectKeys, LowFidelitySection, MeasurementKeys,
    ModelKeys, NumericalErrorSection, ParameterSection, ResponseSection, SamplerKeys,
    ScenarioSection, SimulationKeys, StudySection, SurrogateKeys, ValidateSection,
};
use super::gap::{CandidateKeys, GapSection, SwapKeys, SwitchSection, TermKeys};
use super::libraries::PluginsSection;
use super::schema::Language;
use crate::plugin::manual::{Manual, generator, resolve};
use crate::plugin::registry::NoKeys;
use crate::plugin::{
    Density, Design, Discrepancy, Effect, Executor, Model, Reader, Sampler, Surrogate, Term,
};

/// The schema, for editors that complete and check a study (`lacuna schema`).
pub fn schema() -> Value {
    let mut language = Language::new();
    language
        .table::<StudySection>("study")
        .required("study")
        .table::<PluginsSection>("plugins")
        .tables::<ParameterSection>("parameter")
        .required("parameter")
        .tables::<DerivedSection>("derived")
        .section::<dyn Density, NoKeys>("target")
        .tables::<ScenarioSection>("scenario")
        .table::<ResponseSection>("response")
        .section::<dyn Model, ModelKeys>("model")
        .section::<dyn Design, DesignKeys>("design")
        .section::<dyn Executor, NoKeys>("executor")
        .section::<dyn Reader, SimulationKeys>("simulations")
        .section::<dyn Reader, MeasurementKeys>("measurements")
        .section::<dyn Surrogate, SurrogateKeys>("surrogate")
        .section::<dyn Discrepancy, DiscrepancyKeys>("discrepancy")
        .table::<NumericalErrorSection>("numerical_error")
        .table::<LowFidelitySection>("low_fidelity")
        .sections::<dyn Effect, EffectKeys>("effect")
        .section::<dyn Sampler, SamplerKeys>("sampler")
        .table::<ValidateSection>("validate")
        .table::<GapSection>("gap")
        .sections_in::<dyn Effect, CandidateKeys>("gap", "candidate")
        .tables_in::<SwitchSection>("gap", "switch")
        .sections_in::<dyn Term, TermKeys>("gap", "term")
        .sections_in::<dyn Model, SwapKeys>("gap", "model");
    language.finish()
}

/// The engine's own sections, and its keys in sections that choose a plugin, in the order of a study.
pub fn manual() -> Vec<Manual> {
    vec![
        page::<StudySection>("[study]"),
        page::<PluginsSection>("[plugins]"),
        page::<ParameterSection>("[[parameter]]"),
        page::<DerivedSection>("[[derived]]"),
        page::<ScenarioSection>("[[scenario]]"),
        page::<ResponseSection>("[response]"),
        page::<ModelKeys>("[model]"),
        page::<DesignKeys>("[design]"),
        page::<SimulationKeys>("[simulations]"),
        page::<MeasurementKeys>("[measurements]"),
        page::<SurrogateKeys>("[surrogate]"),
        page::<DiscrepancyKeys>("[discrepancy]"),
        page::<NumericalErrorSection>("[numerical_error]"),
        page::<LowFidelitySection>("[low_fidelity]"),
        page::<EffectKeys>("[[effect]]"),
        page::<SamplerKeys>("[sampler]"),
        page::<ValidateSection>("[validate]"),
        page::<GapSection>("[gap]"),
        page::<CandidateKeys>("[[gap.candidate]]"),
        page::<SwitchSection>("[[gap.switch]]"),
        page::<TermKeys>("[[gap.term]]"),
        page::<SwapKeys>("[[gap.model]]"),
    ]
}

fn page<T: JsonSchema>(name: &str) -> Manual {
    let mut generator = generator();
    let schema = generator.subschema_for::<T>();
    Manual::of_schema(name, &resolve(&schema, &generator), &generator)
}

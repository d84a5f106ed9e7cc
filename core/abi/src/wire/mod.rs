//! Structured data that cross the boundary as JSON, beside the arrays of numbers.

mod complaint;
mod context;
mod data;
mod effect;
mod harvest;
mod model;
mod options;
mod quantity;
mod reader;
mod statistic;
mod training;

pub use complaint::Complaint;
pub use context::OwnedContext;
pub use data::DataAbout;
pub use effect::{EffectAbout, OwnedSituation};
pub use harvest::HarvestAbout;
pub use model::{CallSaid, CallsAbout, ResponseAbout, SignatureAbout};
pub use options::{json_of_node, json_of_table, node_of_json, table_of_json};
pub use quantity::OwnedArguments;
pub use reader::{ContentsAbout, EnsembleAbout, FailureAbout, MeasuredAbout, OwnedSource};
pub use statistic::StatisticAbout;
pub use training::TrainingAbout;

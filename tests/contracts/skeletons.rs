//! The skeletons that `lacuna new plugin` writes: compiled and registered here, each as `skeleton` of its kind, so that
//! every suite tests them.

#[path = "../../cli/src/new/plugin/design.rs"]
mod design;
#[path = "../../cli/src/new/plugin/discrepancy.rs"]
mod discrepancy;
#[path = "../../cli/src/new/plugin/effect.rs"]
mod effect;
#[path = "../../cli/src/new/plugin/executor.rs"]
mod executor;
#[path = "../../cli/src/new/plugin/model.rs"]
mod model;
#[path = "../../cli/src/new/plugin/quantity.rs"]
mod quantity;
#[path = "../../cli/src/new/plugin/reader.rs"]
mod reader;
#[path = "../../cli/src/new/plugin/reliability.rs"]
mod reliability;
#[path = "../../cli/src/new/plugin/sampler.rs"]
mod sampler;
#[path = "../../cli/src/new/plugin/surrogate.rs"]
mod surrogate;
#[path = "../../cli/src/new/plugin/target.rs"]
mod target;
#[path = "../../cli/src/new/plugin/term.rs"]
mod term;

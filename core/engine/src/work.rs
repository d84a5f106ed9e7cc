//! The evaluations of a process of `lacuna work`: of the model of an order, or of the cases of a stage.

use std::path::Path;

use lacuna::plugin::executor::Recipe;
use lacuna::run::Stop;
use lacuna_run::Stage;
use lacuna_run::work::Then;

use crate::coverage;
use crate::host::library;
use crate::pipeline;
use crate::stage::cases::Visit;

/// Builds what an order evaluates, whose jobs have this folder, and hands it over.
pub fn with_model(order: &Recipe, folder: &Path, then: Then<'_>) -> Result<(), Stop> {
    match Visit::of(order, folder)? {
        None => then(&*order.build(&library::load)?),
        Some(visit) if visit.stage == Stage::Coverage => coverage::elsewhere(&visit, then),
        Some(visit) if visit.stage == Stage::Power => pipeline::power_elsewhere(&visit, then),
        Some(visit) if visit.stage == Stage::Surrogate => {
            pipeline::surrogate_elsewhere(&visit, then)
        }
        Some(visit) => Err(Stop::new(format!("the stage `{}` has no cases", visit.stage.folder()))),
    }
}

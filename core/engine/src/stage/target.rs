//! Route of a study whose log density is given.

use lacuna::plugin::Density;
use lacuna::plugin::registry::{NoKeys, Section};
use lacuna::run::{Observer, Stop};
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;

use super::calibrate::{self, Calibrated};
use crate::posterior::Posterior;
use crate::study::Study;

/// Samples the target.
pub fn stage(
    study: &Study,
    target: &Section<dyn Density, NoKeys>,
    posterior: &Posterior<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Calibrated>, Stop> {
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior, p.reference)).collect();
    let laws = study.prior_identity(json!(laws));
    let inputs = json!([
        target.built.identity(),
        laws,
        (section.built.identity(), &section.common),
        study.about.seed
    ]);
    calibrate::draw(study, posterior, None, &Stage::Calibrate.folder(), &inputs, run, observer)
}

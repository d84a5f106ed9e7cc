//! A study of a log density that is given: nothing is run, read or emulated; the density is sampled.

use serde_json::json;

use crate::plugin::Density;
use crate::plugin::registry::{NoKeys, Section};
use crate::posterior::{Given, Posterior};
use crate::report::findings::Findings;
use crate::run::{Kept, Observer, RunDirectory, Stop};
use crate::study::Study;

use super::calibrate::{self, Calibrated};
use super::{assess, evidence, inference_data, report};

/// Samples the target and reports.
pub fn run(
    study: &Study,
    target: &Section<dyn Density, NoKeys>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    let density = target.built.plugin.bind(&study.parameters)?;
    let likelihood = if target.built.plugin.includes_prior() {
        Given::posterior(&*density, &study.parameters)
    } else {
        Given::likelihood(&*density)
    };
    let posterior = Posterior::new(&study.parameters, likelihood);
    let calibrated = stage(study, target, &posterior, run, observer)?;
    let weighed = evidence::stage(study, &posterior, &calibrated, None, run, observer)?;
    let finished = inference_data::Finished {
        calibrated: &calibrated,
        weighed: Some(&weighed),
        validated: None,
    };
    inference_data::of_target(study, &posterior, &finished, run)?;
    let made = report::Artifacts {
        known: None,
        calibrated: Some(&calibrated),
        weighed: Some(&weighed),
        validated: None,
        assessed: None,
        gap: None,
    };
    let assessed = assess::stage(study, &made, run, observer)?;
    let made = report::Artifacts { assessed: Some(&assessed), ..made };
    report::stage(study, &made, run, observer)
}

fn stage(
    study: &Study,
    target: &Section<dyn Density, NoKeys>,
    posterior: &Posterior<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Calibrated>, Stop> {
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior, p.reference)).collect();
    let inputs = json!([
        target.built.identity(),
        laws,
        (section.built.identity(), &section.common),
        study.about.seed
    ]);
    calibrate::draw(study, posterior, None, "5-calibrate", &inputs, run, observer)
}

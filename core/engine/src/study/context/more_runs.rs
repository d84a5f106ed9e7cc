//! Checks of runs that are made after those of the design.

use lacuna::text::Complaints;

use crate::study::plain::Study;

/// Reports what a refinement lacks.
pub(super) fn refinement(study: &Study, complaints: &mut Complaints<'_>) {
    let refine = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref());
    if refine.is_none() {
        return;
    }
    if study.model.is_none() {
        complaints
            .at("surrogate.refine")
            .say("the study has no model to run again")
            .expected("a `[model]` section, or no `refine`");
    }
    if study.sampler.is_none() {
        complaints
            .at("surrogate.refine")
            .say("refinement needs a calibration")
            .expected("`[measurements]`, `[discrepancy]` and `[sampler]`, or no `refine`");
    }
}

/// Reports what a design lacks that places its runs by what earlier ones returned.
pub(super) fn sequential(study: &Study, complaints: &mut Complaints<'_>) {
    let design = study.design.as_ref().filter(|section| section.built.plugin.is_sequential());
    let (Some(design), Some(surrogate)) = (design, &study.surrogate) else { return };
    if study.sampler.is_none() {
        complaints
            .at("design.use")
            .say("the runs of this design follow the measurements, and the study has none")
            .expected("`[measurements]`, `[discrepancy]` and `[sampler]`, or another design");
    }
    if !design.common.extended.is_empty() {
        complaints
            .at("design.extended")
            .say("a sequential design is not extended: its batches follow each other")
            .expected("more `runs`, or `refine` in `[surrogate]`");
    }
    if surrogate.common.validation > 0 {
        complaints
            .at("surrogate.validation")
            .say("the last runs of a sequential design are those near the posterior")
            .expected("`validation = 0`; `emulator_check` in `[validate]` measures the error there")
            .found(surrogate.common.validation);
    }
    if surrogate.common.training.is_some() {
        complaints
            .at("surrogate.training")
            .say("the first runs of a sequential design are the farthest from the posterior")
            .expected("no `training`: all runs near the posterior are used");
    }
}

//! Studies whose model is called directly and has a random response.

use lacuna::plugin::discrepancy::StochasticModel;
use lacuna::text::Complaints;

use crate::study::Study;

impl Study {
    /// Returns true if the calibration calls a model whose response is random.
    pub fn is_stochastic(&self) -> bool {
        let seed = self.model.as_ref().and_then(|model| model.common.seed.as_ref());
        self.surrogate.is_none() && seed.is_some()
    }
}

/// Reports what has no meaning for a likelihood that is estimated from runs of a stochastic model, and a likelihood of
/// that kind without such a model.
pub(super) fn check(study: &Study, complaints: &mut Complaints<'_>) {
    let Some(discrepancy) = &study.discrepancy else { return };
    let role = discrepancy.built.plugin.stochastic_model();
    if !study.is_stochastic() {
        if role == StochasticModel::Needed {
            without_a_seed(study, complaints);
        }
        return;
    }
    if role == StochasticModel::Refused {
        complaints
            .at("discrepancy.use")
            .say("this discrepancy does not know a model whose response is random, as `seed` in `[model]` says")
            .expected("a discrepancy for stochastic models, or a `[surrogate]`, which learns the mean response")
            .help("discrepancies for stochastic models are listed in docs/model_error.md");
    }
    if study.sampler.as_ref().is_some_and(|section| section.built.plugin.uses_gradient()) {
        complaints
            .at("sampler.use")
            .say("this sampler follows derivatives, which an estimated likelihood does not have")
            .expected("a sampler without derivatives")
            .help("docs/samplers.md lists them");
    }
    if !study.starts.is_empty() {
        complaints
            .at("start")
            .say("the calibration of a stochastic model has no search that begins at stated values")
            .help("take `[[start]]` out");
    }
    if study.has_populations() {
        complaints
            .at("model.seed")
            .say("a stochastic model cannot be calibrated with populations")
            .help("give each group a prior of its own: `by` without `population`");
    }
}

fn without_a_seed(study: &Study, complaints: &mut Complaints<'_>) {
    if study.surrogate.is_some() {
        complaints
            .at("discrepancy.use")
            .say("this discrepancy estimates its likelihood from runs of a stochastic model, and the study has a surrogate")
            .expected("no `[surrogate]`, or another discrepancy");
        return;
    }
    complaints
        .at("discrepancy.use")
        .say("this discrepancy needs a model whose response is random, and the model receives no seed")
        .expected("`seed` in `[model]`, the name of the input that receives it, or another discrepancy");
}

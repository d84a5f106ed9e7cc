//! Pieces of the study's own that may be needless beside what is found: terms of its equations, and its effects.

use crate::gap::needless::Own;
use crate::stage::simulator::Simulator;
use crate::study::Study;
use crate::study::unknowns::Unknown;

/// Where between the ends of a prior zero must lie to be a value that it means.
const INSIDE: [f64; 2] = [1e-4, 1.0 - 1e-4];

/// The parameters that are coefficients of summands of rates and may be zero, and the study's effects.
pub fn own_pieces(study: &Study) -> Vec<Own> {
    let mut all: Vec<Own> = coefficients(study).unwrap_or_default();
    let mut begin = study.parameters.len();
    for effect in study.placed_effects() {
        let absent: Vec<(usize, f64)> =
            effect.absent().into_iter().enumerate().map(|(k, x)| (begin + k, x)).collect();
        begin += absent.len();
        all.push(Own { name: effect.name.clone(), absent });
    }
    all
}

fn coefficients(study: &Study) -> Option<Vec<Own>> {
    let simulator = Simulator::of(study).ok()??;
    let amend = simulator.model.amend()?;
    let (layout, _) = study.layouts.of_scenario(&study.scenarios.first()?.name)?;
    let factors = amend.factors(&study.context_of(&layout));
    let own = |(i, unknown): (usize, &Unknown)| {
        let prior = &study.parameters[i].prior;
        let (low, high) = prior.support();
        let below = prior.cdf(0.0);
        let may_be_zero = low == 0.0 || high == 0.0 || (INSIDE[0] < below && below < INSIDE[1]);
        // One that is different in each scenario is several.
        let alone = study.unknowns.iter().filter(|u| u.name == unknown.name).count() == 1;
        (may_be_zero && alone && factors.contains(&unknown.name))
            .then(|| Own { name: unknown.name.clone(), absent: vec![(i, 0.0)] })
    };
    Some(study.unknowns.iter().enumerate().filter_map(own).collect())
}

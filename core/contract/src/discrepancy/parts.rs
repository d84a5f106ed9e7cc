//! Likelihoods of parts of the data.

use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::Likelihood;
use lacuna::run::Stop;

use super::{UNMEASURED, common, data, known, start, truth, without_each};
use crate::judge::agree;

/// The likelihood of a part of the data uses the distribution of all data, whatever the discrepancy estimates from
/// them.
pub(super) fn stands_for_parts(discrepancy: &dyn Discrepancy) -> Result<(), String> {
    let (data, truth, errors) = (data(), truth(), [common("emulator", true)]);
    let known = known(&data, &errors);
    let refused = |stop: Stop| format!("sound data are refused: {stop}");
    let whole = discrepancy.likelihood(&known).map_err(refused)?;
    let hyper = start(&*whole);
    let of = |part: &dyn Likelihood| {
        let all = whole.hyperparameters();
        let own = part.hyperparameters().iter().map(|own| {
            all.iter().position(|other| other.name == own.name).map_or(f64::NAN, |i| hyper[i])
        });
        part.log_likelihood(&truth, &own.collect::<Vec<_>>())
    };
    let Some(same) = discrepancy.likelihood_of_part(&known, &data).map_err(refused)? else {
        return Ok(());
    };
    agree("the likelihood of all data as a part", &[of(&*same)], &[of(&*whole)], 1e-12)?;
    let Some(given) = whole.left_out(&truth, &hyper) else { return Ok(()) };
    let (mut densities, mut quotients) = (Vec::new(), Vec::new());
    for (density, less) in without_each(&data, &given) {
        let part = discrepancy.likelihood_of_part(&known, &less).map_err(refused)?;
        if let Some(part) = part {
            densities.push(density);
            quotients.push(of(&*whole) - of(&*part));
        }
    }
    agree("the density of a value", &densities, &quotients, 1e-8)?;
    gives_its_parts(discrepancy)
}

/// A likelihood that gives that of a part itself gives the one which is made from all that is known: without a replicate
/// of data that have no missing value, without one of a few outputs, and without some values.
fn gives_its_parts(discrepancy: &dyn Discrepancy) -> Result<(), String> {
    let (mut data, truth, errors) = (data(), truth(), [common("emulator", true)]);
    for (r, replicate) in data.replicates.iter_mut().enumerate() {
        for (i, value) in replicate.values.iter_mut().enumerate() {
            let missing = truth[i] + 0.2 * ((3 * i + 7 * r) as f64).sin();
            *value = value.or((i != UNMEASURED).then_some(missing));
        }
    }
    let known = known(&data, &errors);
    let refused = |stop: Stop| format!("sound data are refused: {stop}");
    let whole = discrepancy.likelihood(&known).map_err(refused)?;
    let mut without_one = data.clone();
    without_one.replicates.remove(2);
    let mut without_some = data.clone();
    without_some.replicates[1].values[..4].fill(None);
    for part in [&data, &without_one, &without_some] {
        let Some(own) = whole.of_part(part) else { continue };
        let made = discrepancy.likelihood_of_part(&known, part).map_err(refused)?;
        let Some(made) = made else {
            return Err("a part has a likelihood of one form alone".into());
        };
        let hyper = start(&*whole);
        let both = [&own, &made].map(|l| l.log_likelihood(&truth, &hyper));
        agree("the likelihood of a part", &both[..1], &both[1..], 1e-12)?;
        let [(of_own, hyper_own), (of_made, hyper_made)] =
            [&own, &made].map(|l| l.gradient(&truth, &hyper));
        agree("the derivative by the response", &of_own, &of_made, 1e-10)?;
        agree("the derivative by the hyperparameters", &hyper_own, &hyper_made, 1e-10)?;
        let [of_own, of_made] = [&own, &made].map(|l| variances(&**l, &truth, &hyper));
        agree("the variance predicted", &of_own, &of_made, 1e-12)?;
    }
    Ok(())
}

/// Variances of all parts of a new replicate.
fn variances(likelihood: &dyn Likelihood, truth: &[f64], hyper: &[f64]) -> Vec<f64> {
    likelihood.predictive(truth, hyper).into_iter().flat_map(|part| part.variance).collect()
}

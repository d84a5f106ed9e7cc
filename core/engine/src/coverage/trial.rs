//! One case: data of a truth, and their calibration.

use std::fs;
use std::path::Path;

use lacuna::data::Observations;
use lacuna::diagnose::coverage::{Calibration, Case, Ended, Noise, judge};
use lacuna::math::random::{Stream, below};
use lacuna::run::{Silent, Stop, files};
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;

use super::ground::{Base, Ground};
use super::{Tried, ended, noise, truths};
use crate::stage::calibrate::{self, Calibrated};
use crate::stage::emulated::Emulated;
use crate::stage::idle::Used;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::inverse_problem::Trial;
use crate::stage::read::Data;
use crate::stage::screen::screened;
use crate::stage::{low_fidelity, refine, stream};

/// Generates the data of one truth and calibrates them. The state needed to continue after an interruption is kept in a
/// separate folder until the case is done.
pub fn run(ground: &Ground<'_>, number: usize, folder: &Path) -> Result<Tried, Stop> {
    let response = match &ground.truths.responses[number] {
        Ok(response) => response,
        Err(reason) => return Ok(ended(number, Ended::NoData(reason.clone()))),
    };
    let random = stream(ground.study, "coverage").named("data").at(number as u64);
    let (truth, data) = match made(ground, number, response, &random) {
        Ok(made) => made,
        Err(stop) => return Ok(ended(number, Ended::NoData(stop.message))),
    };
    let values = data.blocks.iter().flat_map(|b| &b.replicates).flat_map(|r| &r.values);
    if values.flatten().any(|y| !y.is_finite()) {
        let reason = "the data of the truth are not finite".to_owned();
        return Ok(ended(number, Ended::NoData(reason)));
    }
    let own = folder.join("cases").join(format!("{:05}", number + 1));
    let scatter = noise::scatter(&data);
    let mut directory = RunDirectory::open(&own)?;
    let outcome = calibrated(ground, number, data, &mut directory);
    let ended = match outcome {
        Ok(calibrated) => Ended::Calibrated(judged(ground, &truth, &calibrated)),
        Err(stop) => Ended::Failed(stop.message),
    };
    drop(directory);
    // Refined cases contain runs of the model, which should not be repeated.
    if !matches!(ended, Ended::Failed(_)) && !is_refined(ground) {
        fs::remove_dir_all(&own).map_err(|error| files::cannot_write(&own, &error))?;
    }
    Ok(Tried { case: Case { number, ended }, scatter })
}

fn is_refined(ground: &Ground<'_>) -> bool {
    ground.study.surrogate.as_ref().is_some_and(|s| s.common.refine.is_some())
}

/// Values of all unknowns whose truths are known, and data generated from them.
fn made(
    ground: &Ground<'_>,
    number: usize,
    response: &[f64],
    random: &Stream,
) -> Result<(Vec<f64>, Observations), Stop> {
    let study = ground.study;
    let problem = ground.base.problem(ground.truths.parts[number]);
    let theta = ground.truths.points.row(number);
    let mut truth = theta.to_vec();
    let mut response = response.to_vec();
    for (k, effect) in study.placed_effects().iter().enumerate() {
        let values =
            truths::of_priors(&effect.hyperparameters(), &random.named("effect").at(k as u64));
        response = effect.apply(&response, &values, theta);
        truth.extend(values);
    }
    let measured = ground.measured();
    let noise = random.named("noise");
    if ground.noise == Noise::Replicates {
        return Ok((truth, noise::of_replicates(&measured.used, &response, &noise)?));
    }
    let chosen = below(&mut random.named("fit").generator(), ground.fits.len());
    let (point, fitted) = &ground.fits[chosen];
    let hyper = match ground.noise {
        Noise::Prior => {
            let own = &ground.coordinates[truth.len()..];
            let mut rng = random.named("hyper").generator();
            own.iter().map(|c| c.prior.sample(&mut rng)).collect()
        }
        _ => point[truth.len()..].to_vec(),
    };
    let both = [&fitted[..], &response[..]];
    let data =
        noise::of_discrepancy(study, problem.forward(), &measured.used, both, &hyper, &noise)?;
    truth.extend(hyper);
    Ok((truth, data))
}

/// Calibrates data, with the study's own emulator and sampler.
fn calibrated(
    ground: &Ground<'_>,
    number: usize,
    data: Observations,
    directory: &mut RunDirectory,
) -> Result<Calibrated, Stop> {
    let study = ground.study;
    let section = study.measurements.as_ref();
    let keys = &section.ok_or_else(|| Stop::new("the study has no measurements"))?.common;
    let part = ground.truths.parts[number];
    let problem = ground.base.problem(part);
    let measured = Some(screened(keys, data));
    let hash = files::hash(json!([problem.data.hash, number]).to_string().as_bytes());
    let ensemble = if is_refined(ground) { problem.data.value.ensemble.clone() } else { None };
    let cheaper = if is_refined(ground) { problem.data.value.cheaper.clone() } else { None };
    let value = Data { ensemble, measured, cheaper };
    let data = Kept { value, hash, ..kept_without(problem.data) };
    let trial = Some(Trial { number: number as u64, quick: ground.quick });
    let calibrated = match &ground.base {
        Base::Emulated(all) if is_refined(ground) => {
            let learned = copied(ground, &all[part], data, trial)?;
            refine::stage(study, learned, directory, &Silent)?.1
        }
        _ => {
            let problem = InverseProblem::new(&data, problem.route, trial);
            calibrate::stage(study, &problem, &Stage::Calibrate.folder(), directory, &Silent)?
        }
    };
    calibrated.map(|kept| kept.value).ok_or_else(|| Stop::new("the study has no posterior"))
}

fn kept_without(kept: &Kept<Data>) -> Kept<Data> {
    let value = Data { ensemble: None, measured: None, cheaper: None };
    Kept { value, hash: String::new(), seconds: kept.seconds, fresh: kept.fresh }
}

/// Copy of the emulator and its data, for a refinement that continues from it.
fn copied(
    ground: &Ground<'_>,
    learned: &Emulated,
    data: Kept<Data>,
    trial: Option<Trial>,
) -> Result<Emulated, Stop> {
    let (study, fitted) = (ground.study, learned.fitted.clone());
    let used = Used::of(study)?;
    let emulator = used.widen(low_fidelity::load(study, &fitted.value.bytes.bytes()?)?);
    Emulated::new(study, data, (fitted, emulator), learned.numerics.clone(), trial)
}

fn judged(ground: &Ground<'_>, truth: &[f64], calibrated: &Calibrated) -> Calibration {
    let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
    judge(&ground.coordinates, truth, &draws, &calibrated.outcome.diagnosis)
}

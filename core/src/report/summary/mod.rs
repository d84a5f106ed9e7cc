//! `summary.json`: the results that scripts read.

mod gap;

use serde_json::{Map, Value, json};

use crate::assess::{Finding, Severity};

use super::findings::{
    CalibrationFindings, CoordinateFindings, Findings, LeftOutFindings, SurrogateFindings,
    ValidationCase,
};
use super::qualified;

/// The version of the keys and their meaning.
pub const SCHEMA: u64 = 1;

/// The content of `summary.json`.
///
/// Numbers are in the study's own units, unrounded; one that is not finite is `null`. A part is
/// absent when the run did not make it.
///
/// | key | meaning |
/// |---|---|
/// | `schema` | version of this table: 1 |
/// | `study`, `title`, `seed`, `version` | the study's name and title, its seed, the version of Lacuna |
/// | `components.KIND` | the plugin that the study chose, such as `sampler`: `affine_invariant_ensemble` |
/// | `assessment.level` | whether the result can be trusted: `trusted`, `trusted_with_reservations`, `not_trusted` |
/// | `assessment.findings[]` | what speaks for that, the worst first: `code`, `where` (parameter, sensor, run), `figure`, `threshold`, `severity` (`note`, `reservation`, `failure`), `message`, `action`; `docs/assessment.md` lists the codes |
/// | `warnings` | reservations and failures in words, and everything that was told as a warning on the way |
/// | `runs.used`, `.failed`, `.invalid`, `.in_prior` | simulation runs with a response, without one, outside the model's validity, inside the prior's support |
/// | `data.replicates`, `.values`, `.count` | replicates used, their measured values, the number of data in the likelihood |
/// | `data.sha256` | hash of those data: evidences and predictions are comparable where it is the same |
/// | `data.added_curves` | curves per group that the likelihood counts beside the replicates |
/// | `data.flagged` | how many curves the screen flagged; `data.left_out`: how many of them were left out |
/// | `surrogate.mae`, `.rmse` | mean absolute and root mean square error over the validation runs, in `surrogate.unit` |
/// | `surrogate.loo` | leave-one-out error relative to the outputs' variance, mean over outputs |
/// | `surrogate.training`, `.validation` | numbers of runs |
/// | `surrogate.near_posterior` | root mean square difference between the emulator and the model, run anew at posterior draws (`validate.emulator_check`), in `surrogate.unit` |
/// | `surrogate.refine.rounds`, `.ratio`, `.reached` | rounds of refinement; the emulator's error near the posterior over the discrepancy; whether that is small enough |
/// | `surrogate.sobol` | for each parameter its `first` and `total` index, where known |
/// | `parameters.NAME` | parameters, hyperparameters and derived quantities, in that order |
/// | `….mean`, `.sd`, `.q025`, `.median`, `.q975` | of the posterior draws after the burn-in |
/// | `….map` | where the posterior density has its maximum |
/// | `….r_hat`, `.ess_bulk`, `.ess_tail`, `.mcse_mean` | rank-normalised split R-hat, effective sample sizes, Monte Carlo standard error of the mean |
/// | `….autocorrelation_time` | integrated autocorrelation time in steps |
/// | `….unit` | the unit of all these but R-hat and the sample sizes |
/// | `….role` | `parameter`, `hyperparameter` or `derived` |
/// | `….reference` | the study's reference value, where it gives one |
/// | `correlation.names`, `.matrix` | posterior correlation, rows and columns in the order of `names` |
/// | `acceptance.mean`, `.min`, `.max` | share of accepted moves over the chains |
/// | `chains.count`, `.steps`, `.burn_in`, `.stranded` | the chains; `stranded` lists those that stayed far below the bulk of the density, from 0 |
/// | `converged`, `verdict` | whether the run converged, and why in words |
/// | `log_density.map`, `.best_draw` | log posterior density at the MAP and at the best draw |
/// | `evidence.log`, `.error`, `.method` | log probability of the data, its standard error, how it was found; `evidence.limit`: why it is that of a part only, where a mode has no draws |
/// | `loo.elpd`, `.error`, `.parameters`, `.unreliable`, `.count` | log predictive density of each datum from all others, summed (PSIS-LOO), its standard error as if the data were independent, the effective number of parameters, how many of the data have estimates not to trust, and how many data there are |
/// | `loo.error_by_curve`, `.k_limit` | the standard error from the scatter over curves, whose values may depend on each other (null below two curves); the largest k-hat that the number of draws allows |
/// | `loo.curves.elpd`, `.error`, `.parameters`, `.unreliable`, `.count` | the same for whole curves, each predicted from all others; `loo.curves` is null where that is not known |
/// | `accuracy.CASE.GROUP` | share of points inside the replicates' 95 % interval; cases `map`, `reference`; `average` is the mean over the groups |
/// | `rmse.CASE` | root mean square difference from the replicates' mean, in the response's unit |
/// | `simulated.CASE` | whether the model itself was run there (else the emulator answered) |
/// | `spread.ORIGIN` | standard deviation of a new replicate by origin, root mean square over outputs, in the response's unit |
/// | `gap.verdict` | after `lacuna gap STUDY`: `none`, `named`, `class`, `unlisted` or `not_visible`; `gap.reasons`: why, in words |
/// | `gap.p`, `.p_after` | probabilities, if nothing were missing, of the largest score, the best cell of the scan and the energy, without and with the effects |
/// | `gap.noise_assumed` | whether the noise of some curve is assumed, for want of replicates |
/// | `gap.effects[]` | what explains most: `type` (`model_swap`: another model in place of the study's, then first), `name`, `sensors` (labels; none: everywhere), `on` (labels by axis), `parameters.UNKNOWN` with `mean`, `sd`, `unit` (and `q025`, `q975` once the study with the effects was run; before, the largest density and the normal approximation), `probability` among the candidates, `class` |
/// | `gap.class` | types that the data cannot tell apart, where the verdict is `class` |
/// | `gap.regions[]`, `.regions_after[]` | where data and model disagree: `sensors`, `scenario`, `time` (first and last place on the last axis), `band` (frequencies, or `null` for all), `p` |
/// | `gap.held_out` | how the study with what was found, where it was run, fares, else the search: `kind` of what was set aside, `names`, `count`; the gap `before` and `after` in standard deviations of the noise; the share of its square that `closed`, `lower` and `upper` end of the 95 % interval; `beyond_known_errors`, the same five without what known errors of emulator and numerics could explain; `shrank`; `rmse`, `coverage` of the 95 % band and `accuracy`, each `before` and `after`; `log_score`, the log predictive density gained, `conditions.SCENARIO` |
/// | `gap.held_out_further[]` | the same of other kinds |
/// | `gap.parameters.NAME` | `before` and `after`: `map` and `sd` without and with the effects, from the data that were not set aside |
/// | `gap.models.NAME` | another model in place of the study's, each after its own calibration and without effects: `log_odds`, the log of the probability of the data with it over that with the study's, and its standard `error` |
/// | `gap.needless.NAME` | a coefficient or an effect of the study's own that is not needed beside what was found: `log_odds`, the log of the probability of the data without it over that with it (above log 3), and its standard `error` |
/// | `gap.insight` | `foretold[]` (log score of left-out parts against `against`), `drift` (`reading`, `words`, `p` of equal parameters in all conditions and windows), and where there are any `separations`, `places`, `symbolic`, `stopgap` |
/// | `gap.study`, `.run`, `.log_evidence` | the study with the effects, its run directory, and the evidences `before` and `after`, once it was run |
/// | `seconds.STAGE` | wall-clock time when the stage's result was made |
/// | `made_by.STAGE` | the version of Lacuna that made the stage's result |
pub fn summary(findings: &Findings) -> Value {
    let mut summary = Map::new();
    let mut put = |key: &str, value: Value| summary.insert(key.to_owned(), value);
    put("schema", json!(SCHEMA));
    put("study", json!(findings.study));
    put("title", json!(findings.title));
    put("seed", json!(findings.seed));
    put("version", json!(findings.version));
    put("components", components(findings));
    put("assessment", json!(findings.assessment));
    put("warnings", json!(warnings(findings)));
    if let Some(runs) = runs(findings) {
        put("runs", runs);
    }
    if let Some(data) = data(findings) {
        put("data", data);
    }
    if let Some(found) = &findings.surrogate {
        put("surrogate", surrogate(findings, found));
    }
    if let Some(calibration) = &findings.calibration {
        put("parameters", parameters(calibration));
        put("correlation", correlation(calibration));
        if !calibration.acceptance.is_empty() {
            put("acceptance", acceptance(calibration));
        }
        put("chains", chains(calibration));
        put("converged", json!(calibration.converged));
        put("verdict", json!(qualified::convergence(findings, calibration)));
        let (map, best) = calibration.log_density;
        put("log_density", json!({ "map": map, "best_draw": best }));
        if let Some(e) = &calibration.evidence {
            let mut evidence = json!({ "log": e.log, "error": e.error, "method": e.method });
            if let Some(limit) = qualified::evidence(findings) {
                evidence["limit"] = json!(limit);
            }
            put("evidence", evidence);
        }
        if let Some(loo) = &calibration.left_out {
            put("loo", left_out(loo));
        }
    }
    if let Some(validation) = &findings.validation {
        let cases = &validation.cases;
        put("accuracy", by_case(cases, accuracy));
        put("rmse", by_case(cases, |case| json!(case.rmse)));
        put("simulated", by_case(cases, |case| json!(case.simulated)));
        put("spread", pairs(&validation.spread));
    }
    if let Some(found) = &findings.gap {
        put("gap", gap::value(found));
    }
    put("seconds", pairs(&findings.seconds));
    let made_by = findings.made_by.iter().map(|(stage, version)| (stage.clone(), json!(version)));
    put("made_by", made_by.collect::<serde_json::Map<_, _>>().into());
    Value::Object(summary)
}

/// The text of `summary.json`.
pub fn summary_json(findings: &Findings) -> String {
    format!("{:#}\n", summary(findings))
}

/// Failures and reservations in words, then what was told on the way.
fn warnings(findings: &Findings) -> Vec<String> {
    let grave = findings.assessment.findings.iter().filter(|f| f.severity > Severity::Note);
    grave.map(Finding::sentence).chain(findings.warnings.iter().cloned()).collect()
}

fn components(findings: &Findings) -> Value {
    let named = findings.components.iter().map(|(kind, plugin)| (kind.clone(), json!(plugin)));
    named.collect::<Map<_, _>>().into()
}

fn runs(findings: &Findings) -> Option<Value> {
    let ensemble = findings.ensemble.as_ref()?;
    Some(json!({
        "used": ensemble.points.rows(),
        "failed": ensemble.failed.len(),
        "invalid": ensemble.valid.iter().filter(|valid| !**valid).count(),
        "in_prior": ensemble.in_prior,
    }))
}

fn data(findings: &Findings) -> Option<Value> {
    let measured = findings.measured.as_ref()?;
    Some(json!({
        "replicates": measured.used.replicates(),
        "values": measured.used.count(),
        "count": measured.data_count,
        "sha256": measured.fingerprint,
        "added_curves": measured.added_curves,
        "flagged": measured.flagged.len(),
        "left_out": measured.flagged.iter().filter(|curve| curve.left_out).count(),
    }))
}

fn surrogate(findings: &Findings, found: &SurrogateFindings) -> Value {
    let mut value = json!({
        "mae": found.mae,
        "rmse": found.rmse,
        "loo": found.loo,
        "unit": findings.layouts.unit().to_string(),
        "training": found.training,
        "validation": found.validation,
    });
    if let Some((error, _)) = found.near_posterior {
        value["near_posterior"] = json!(error);
    }
    if let Some((rounds, ratio, reached)) = found.refinement {
        value["refine"] = json!({ "rounds": rounds, "ratio": ratio, "reached": reached });
    }
    if let Some(sobol) = &found.sobol {
        let named = findings.parameters.iter().zip(sobol);
        value["sobol"] = named
            .map(|(p, (first, total))| (p.name.clone(), json!({ "first": first, "total": total })))
            .collect::<Map<_, _>>()
            .into();
    }
    value
}

fn parameters(calibration: &CalibrationFindings) -> Value {
    let named = calibration.coordinates.iter().map(|c| (c.name.clone(), coordinate(c)));
    named.collect::<Map<_, _>>().into()
}

fn coordinate(c: &CoordinateFindings) -> Value {
    let mut value = json!({
        "mean": c.mean,
        "sd": c.sd,
        "q025": c.q025,
        "median": c.median,
        "q975": c.q975,
        "map": c.map,
        "r_hat": c.r_hat,
        "ess_bulk": c.ess_bulk,
        "ess_tail": c.ess_tail,
        "mcse_mean": c.mcse_mean,
        "autocorrelation_time": c.autocorrelation_time,
        "unit": c.unit.to_string(),
        "role": c.role,
    });
    if let Some(reference) = c.reference {
        value["reference"] = json!(reference);
    }
    value
}

fn correlation(calibration: &CalibrationFindings) -> Value {
    let names: Vec<&str> = calibration.coordinates.iter().map(|c| c.name.as_str()).collect();
    let matrix: Vec<&[f64]> = calibration.correlation.iter_rows().collect();
    json!({ "names": names, "matrix": matrix })
}

fn left_out(loo: &LeftOutFindings) -> Value {
    json!({
        "elpd": loo.elpd,
        "error": loo.error,
        "error_by_curve": loo.error_by_curve,
        "parameters": loo.parameters,
        "unreliable": loo.unreliable,
        "k_limit": loo.limit,
        "count": loo.count,
        "curves": loo.curves.as_ref().map(|curves| json!({
            "elpd": curves.elpd,
            "error": curves.error,
            "parameters": curves.parameters,
            "unreliable": curves.unreliable,
            "count": curves.count,
        })),
    })
}

fn acceptance(calibration: &CalibrationFindings) -> Value {
    let shares = &calibration.acceptance;
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let min = shares.iter().copied().fold(f64::NAN, f64::min);
    let max = shares.iter().copied().fold(f64::NAN, f64::max);
    json!({ "mean": mean, "min": min, "max": max })
}

fn chains(calibration: &CalibrationFindings) -> Value {
    json!({
        "count": calibration.chains,
        "steps": calibration.steps,
        "burn_in": calibration.burn_in,
        "stranded": calibration.stranded,
    })
}

fn accuracy(case: &ValidationCase) -> Value {
    let mut value = pairs(&case.accuracy);
    // With one replicate there is no interval, and nothing to average.
    value["average"] = if case.accuracy.is_empty() { Value::Null } else { json!(case.average) };
    value
}

fn by_case(cases: &[ValidationCase], value: impl Fn(&ValidationCase) -> Value) -> Value {
    cases.iter().map(|case| (case.name.clone(), value(case))).collect::<Map<_, _>>().into()
}

fn pairs(pairs: &[(String, f64)]) -> Value {
    pairs.iter().map(|(name, value)| (name.clone(), json!(value))).collect::<Map<_, _>>().into()
}

//! Stage 8: results for people (`report.html`) and for scripts (`summary.json`).

use std::fs;
use std::path::Path;

use lacuna::data::{Draws, Ensemble, Observations, Parameter};
use lacuna::diagnose::Diagnosis;
use lacuna::math::distribution::Distribution;
use lacuna::math::moments::Moments;
use lacuna::math::{fit, moments};
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::directory::Record;
use lacuna_run::{Kept, RunDirectory, Stage};
use rayon::prelude::*;

use crate::assess::Assessment;
use crate::gap::result::{GapFindings, GapResult, added};
use crate::page::FigureFile;
use crate::report::findings::{
    CalibrationFindings, CoordinateFindings, CurvesLeftOutFindings, EnsembleFindings,
    FieldFindings, Findings, FittedDistribution, LeftOutFindings, MeasuredFindings, Role, RunInput,
    SurrogateFindings,
};
use crate::report::{missing, page, summary};
use crate::screening::{Screening, screen};
use crate::stage::artifacts::Artifacts;
use crate::stage::calibrate::Calibrated;
use crate::stage::drawn::drawn;
use crate::stage::energies::energies;
use crate::stage::evidence::Weighed;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::main_effects::main_effects;
use crate::stage::mixing::mixing;
use crate::stage::read::Measured;
use crate::stage::validate::Validated;
use crate::stage::{derived, fields};
use crate::study::Study;

/// Results to be reported.
#[derive(Clone, Copy)]
pub struct Results<'a> {
    /// Artifacts of the stages up to the validation.
    pub artifacts: Artifacts<'a>,
    /// Assessment of whether the results can be trusted.
    pub assessed: &'a Kept<Assessment>,
    /// Result of the gap search, if one was made.
    pub gap: Option<&'a Kept<GapResult>>,
}

/// Writes the report and the summary; returns the findings.
pub fn stage(
    study: &Study,
    results: &Results<'_>,
    run: &RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    let calibrated = results.artifacts.calibrated.map(|kept| derived::extended(study, &kept.value));
    let calibrated = calibrated.as_ref();
    let findings = findings(study, results, calibrated, run, observer);
    let root = run.root();
    files::write_json(&root.join("summary.json"), &summary(&findings))?;
    let (page, figures) = page(&findings);
    files::write_atomic(
        &run.stage_folder(&Stage::Report.folder()).join("report.html"),
        page.as_bytes(),
    )?;
    write_figures(&root.join("figures"), &figures)?;
    files::write_atomic(&root.join("report.html"), page.as_bytes())?;
    Ok(findings)
}

/// Writes each figure as `NAME.svg` and `NAME.csv`, and removes those of figures that the report no longer has.
fn write_figures(folder: &Path, figures: &[FigureFile]) -> Result<(), Stop> {
    fs::create_dir_all(folder).map_err(|error| files::cannot_write(folder, &error))?;
    for FigureFile { name, svg, csv } in figures {
        files::write_atomic(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
        files::write_atomic(&folder.join(format!("{name}.csv")), csv.as_bytes())?;
    }
    let found = fs::read_dir(folder).map_err(|error| files::cannot_read(folder, &error))?;
    for path in found.filter_map(|entry| Some(entry.ok()?.path())) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stem = name.strip_suffix(".svg").or_else(|| name.strip_suffix(".csv"));
        if stem.is_some_and(|stem| figures.iter().all(|figure| figure.name != stem)) {
            fs::remove_file(&path).map_err(|error| files::cannot_write(&path, &error))?;
        }
    }
    Ok(())
}

fn findings(
    study: &Study,
    results: &Results<'_>,
    calibrated: Option<&Calibrated>,
    run: &RunDirectory,
    observer: &dyn Observer,
) -> Findings {
    let all = &results.artifacts;
    let measured = all.measured();
    let weighed = all.weighed.map(|w| &w.value);
    let calibration = calibrated.map(|c| calibration(study, c, weighed));
    let drawn = all.problem.zip(calibrated).and_then(|(problem, calibrated)| {
        drawn(study, problem, &calibrated.draws.from_step(calibrated.outcome.burn_in))
    });
    let validation =
        all.validated.zip(measured).map(|(kept, measured)| kept.value.findings(measured));
    let missing = results.gap.and_then(|gap| missing::finding(&gap.value, calibration.as_ref()?));
    let stage = |r: &Record| r.stage.split_once('-').map_or(&*r.stage, |s| s.1).to_owned();
    let seconds = run.records().iter().map(|r| (stage(r), r.seconds)).collect();
    let made_by = run.records().iter().map(|r| (stage(r), r.lacuna.clone())).collect();
    Findings {
        title: study.about.title.clone(),
        study: study.name.clone(),
        seed: study.about.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        components: components(study),
        parameters: study.parameters.clone(),
        intervals: study.intervals(),
        fields: fields(study, calibrated),
        prior: study.prior_facts(),
        layouts: study.layouts.clone(),
        ensemble: all.problem.and_then(|problem| {
            Some(ensemble(study, problem, problem.data.value.ensemble.as_ref()?))
        }),
        measured: measured.map(|m| measurements(study, m)),
        surrogate: all.problem.and_then(|problem| surrogate(study, problem, all.validated)),
        warnings: {
            let named = results.gap.and_then(|kept| kept.value.warning()).map(str::to_owned);
            warnings(observer).into_iter().chain(named).collect()
        },
        assessment: results.assessed.value.with(missing),
        calibration,
        drawn,
        validation,
        quantities: all.quantities.map(|kept| kept.value.findings()).unwrap_or_default(),
        propagated: all.quantities.and_then(|kept| kept.value.propagated.clone()),
        reliability: all.reliability.map(|kept| kept.value.events.clone()).unwrap_or_default(),
        gap: results.gap.map(|kept| GapFindings {
            result: kept.value.clone(),
            hash: kept.hash.clone(),
            added: added::kept(run, &kept.hash),
        }),
        seconds,
        made_by,
        note: study.about.note.clone(),
    }
}

/// The random fields, under the posterior if there is a calibration.
fn fields(study: &Study, calibrated: Option<&Calibrated>) -> Vec<FieldFindings> {
    let kept = calibrated.map(|c| c.draws.from_step(c.outcome.burn_in));
    fields::findings(study, kept.as_ref())
}

fn components(study: &Study) -> Vec<(String, String)> {
    let chosen = study.components().into_iter();
    chosen.map(|chosen| (chosen.section.to_owned(), chosen.name.to_owned())).collect()
}

fn ensemble(study: &Study, problem: &InverseProblem<'_>, e: &Ensemble) -> EnsembleFindings {
    let follows = follows_data(study);
    let active = problem.fitted().and_then(|fitted| fitted.value.active.clone());
    let inside = |point: &&[f64]| study.prior().allows(point);
    EnsembleFindings {
        points: e.points.clone(),
        inputs: inputs(study),
        valid: e.valid.clone(),
        failed: e.failed.clone(),
        in_prior: e.points.iter_rows().filter(inside).count(),
        screening: if follows { None } else { screening(study, e) },
        active: active.filter(|_| !follows),
    }
}

/// True if some runs follow the data: the inputs then depend on each other.
fn follows_data(study: &Study) -> bool {
    study.surrogate.as_ref().is_some_and(|s| s.common.refine.is_some())
        || study.design.as_ref().is_some_and(|d| d.built.plugin.is_sequential())
}

/// Effects of the inputs as far as the runs show them; `None` if there are too few runs.
fn screening(study: &Study, e: &Ensemble) -> Option<Screening> {
    let designs = study.trained().parameters.iter().map(|p| &p.design);
    let column = |input: &RunInput| input.places.first().copied();
    let columns: Vec<usize> = inputs(study).iter().map(column).collect::<Option<_>>()?;
    let placed: Vec<(&Distribution, usize)> = designs.zip(columns).collect();
    let positions = Matrix::from_fn(e.points.rows(), placed.len(), |i, j| {
        let (design, column) = placed[j];
        design.cdf(e.points[(i, column)])
    });
    screen(&positions, &e.responses, e.layouts.ranges())
}

fn inputs(study: &Study) -> Vec<RunInput> {
    let trained = study.trained();
    let by_group = study.hierarchy.trained.is_some();
    let of = |(i, parameter): (usize, &Parameter)| {
        let name = &trained.unknowns[i].name;
        let places = || study.unknowns.iter().enumerate().filter(|(_, u)| !u.of_population());
        RunInput {
            name: parameter.name.clone(),
            symbol: parameter.symbol.clone(),
            places: if by_group {
                places().filter(|(_, u)| u.name == *name).map(|(j, _)| j).collect()
            } else {
                vec![i]
            },
        }
    };
    trained.parameters.iter().enumerate().map(of).collect()
}

fn measurements(study: &Study, measured: &Measured) -> MeasuredFindings {
    let added =
        study.measurements.as_ref().map(|s| s.common.added_curves.len()).unwrap_or_default();
    let curves = measured.likelihood.blocks[0].replicates.iter().rev().take(added).rev();
    MeasuredFindings {
        used: measured.used.clone(),
        flagged: measured.flagged.clone(),
        data_count: measured.likelihood.count(),
        fingerprint: fingerprint(&measured.likelihood),
        added_curves: curves.map(|r| r.name.clone()).collect(),
    }
}

/// Hash of the data in the likelihood; the evidences of two runs are comparable only if it is equal.
fn fingerprint(data: &Observations) -> String {
    let values = data.blocks.iter().flat_map(|b| &b.replicates).flat_map(|r| &r.values);
    files::hash_of(values.map(|y| y.unwrap_or(f64::NAN)))
}

fn surrogate(
    study: &Study,
    problem: &InverseProblem<'_>,
    validated: Option<&Kept<Validated>>,
) -> Option<SurrogateFindings> {
    let errors = &problem.fitted()?.value.errors;
    let unit = problem.data.value.ensemble.as_ref().map(|e| e.layouts.unit().to_string());
    let unit = unit.unwrap_or_default();
    let of_numerics = problem.numerics().into_iter().flat_map(|kept| kept.value.facts(&unit));
    let sobol = problem.emulator()?.sensitivity().map(|s| {
        let total = s.aggregated.total.row(0).iter();
        s.aggregated.first.row(0).iter().zip(total).map(|(f, t)| (*f, *t)).collect()
    });
    Some(SurrogateFindings {
        refinement: problem.refinement().map(|r| (r.rounds, r.ratio, r.of, r.reached)),
        facts: errors.facts.iter().cloned().chain(of_numerics).collect(),
        training: errors.training,
        validation: errors.validation,
        mae: errors.mae,
        rmse: errors.rmse,
        loo: errors.loo,
        by_group: errors.by_group.clone(),
        near_posterior: validated.and_then(|v| v.value.emulator_at_posterior),
        pairs: errors.pairs.clone(),
        loo_by_output: errors.loo_by_output.clone(),
        total_by_output: problem.emulator()?.sensitivity().map(|s| s.outputs.total),
        sobol,
        main_effects: main_effects(study, problem),
    })
}

fn calibration(
    study: &Study,
    calibrated: &Calibrated,
    weighed: Option<&Weighed>,
) -> CalibrationFindings {
    let outcome = &calibrated.outcome;
    let kept = calibrated.draws.from_step(outcome.burn_in);
    let role = |j: usize| match calibrated.outcome.coordinates[j].prior {
        None => Role::Derived,
        Some(_) if j < study.parameters.len() => Role::Parameter,
        Some(_) => Role::Hyperparameter,
    };
    let one = |j: usize| coordinate(calibrated, &kept, j, role(j));
    let coordinates: Vec<CoordinateFindings> =
        (0..kept.dimension()).into_par_iter().map(one).collect();
    let times: Vec<f64> = coordinates.iter().map(|c| c.autocorrelation_time).collect();
    CalibrationFindings {
        coordinates,
        draws: calibrated.draws.values.clone(),
        chains: calibrated.draws.chains,
        steps: calibrated.draws.steps,
        burn_in: outcome.burn_in,
        correlation: correlation(&kept),
        acceptance: outcome.acceptance.clone(),
        stranded: outcome.diagnosis.stranded.to_the_end.clone(),
        converged: outcome.diagnosis.converged,
        verdict: verdict(&outcome.diagnosis),
        log_density: (outcome.map_log_density, outcome.best_draw.1),
        best_draw: outcome.best_draw.0.clone(),
        energies: energies(&calibrated.statistics, outcome.burn_in),
        mixing: mixing(&kept, &outcome.diagnosis.stranded.to_the_end, &times),
        facts: outcome.facts.clone(),
        populations: outcome.populations.clone(),
        evidence: weighed.and_then(|w| w.evidence.clone()),
        left_out: weighed.and_then(|w| w.left_out.as_ref()).map(|loo| LeftOutFindings {
            elpd: loo.elpd,
            error: loo.error,
            error_by_curve: loo.error_by_curve,
            parameters: loo.parameters,
            unreliable: loo.unreliable,
            limit: loo.limit,
            count: loo.data.len(),
            k_hat: loo.data.iter().map(|left| left.k_hat).collect(),
            below: weighed.map(|w| w.below.clone()).unwrap_or_default(),
            curves: weighed.and_then(|w| w.curves_left_out.as_ref()).map(|curves| {
                CurvesLeftOutFindings {
                    elpd: curves.elpd,
                    error: curves.error,
                    parameters: curves.parameters,
                    unreliable: curves.unreliable,
                    count: curves.data.len(),
                }
            }),
        }),
    }
}

fn verdict(diagnosis: &Diagnosis) -> String {
    if diagnosis.converged && diagnosis.advice.is_empty() {
        "converged".to_owned()
    } else {
        diagnosis.advice.join("; ")
    }
}

fn coordinate(calibrated: &Calibrated, kept: &Draws, j: usize, role: Role) -> CoordinateFindings {
    let outcome = &calibrated.outcome;
    let about = &outcome.coordinates[j];
    let judged = &outcome.diagnosis.coordinates[j];
    let pooled = kept.pooled(j);
    let sorted = moments::sorted(&pooled);
    let fits = fit::fit(&pooled, judged.ess_bulk);
    let best = fits.first().map_or(0.0, |f| f.aic);
    CoordinateFindings {
        name: about.name.clone(),
        symbol: about.symbol.clone(),
        unit: about.unit.clone(),
        role,
        prior: about.prior.clone(),
        reference: about.reference,
        mean: moments::mean(&pooled),
        sd: moments::variance(&pooled).sqrt(),
        q025: moments::quantile(&sorted, 0.025),
        median: moments::quantile(&sorted, 0.5),
        q975: moments::quantile(&sorted, 0.975),
        map: outcome.map[j],
        r_hat: judged.r_hat,
        ess_bulk: judged.ess_bulk,
        ess_tail: judged.ess_tail,
        mcse_mean: judged.mcse_mean,
        autocorrelation_time: judged.autocorrelation_time,
        fits: fits
            .into_iter()
            .map(|f| FittedDistribution {
                delta_aic: f.aic - best,
                distribution: f.distribution,
                ks: f.distance,
                p_value: f.probability,
            })
            .collect(),
    }
}

fn correlation(kept: &Draws) -> Matrix {
    Moments::of_rows(&kept.points()).correlation()
}

/// Warnings given so far, without repetition.
fn warnings(observer: &dyn Observer) -> Vec<String> {
    let mut warnings: Vec<String> = Vec::new();
    for text in observer.heard() {
        if !warnings.contains(&text) {
            warnings.push(text);
        }
    }
    warnings
}

//! Second layer of checking: the sections of a study against each other.

mod companion;
mod cut;
mod effects;
mod gap;
pub(super) mod gradients;
mod inputs;
mod inside;
mod more_runs;
mod next;
mod noise;
mod outputs;
mod quantities;
mod reliability;
mod runs;
mod stochastic;

use lacuna::data::{Layout, Parameter, Scenario};
use lacuna::math::moments;
use lacuna::math::random::Stream;
use lacuna::plugin::{Component, Context, Surrogate, registry};
use lacuna::text::nearest::one_of;
use lacuna::text::{Complaints, Node, Problems};

use super::fidelity::LowFidelity;
use super::plain::Study;
use super::table::Chosen;
use super::unknowns::Unknown;

/// Reports everything that is inconsistent.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let before = problems.len();
    super::sizes::check(study, root, problems);
    // What follows may make what it looks at.
    if problems.len() > before {
        return;
    }
    let mut complaints = Complaints::new(root, problems);
    folder(study, &mut complaints);
    if study.target.is_some() {
        beside_a_target(study, root, &mut complaints);
    } else {
        sections(study, &mut complaints);
    }
    parameters(study, &mut complaints);
    super::intervals::check(study, root, &mut complaints);
    super::hierarchy::check(study, &mut complaints);
    runs(study, &mut complaints);
    more_runs::refinement(study, &mut complaints);
    more_runs::sequential(study, &mut complaints);
    stochastic::check(study, &mut complaints);
    gradients::check(study, &mut complaints);
    cut::check(study, &mut complaints);
    validation(study, &mut complaints);
    if let Some(model) = &study.model {
        for (place, scenario) in study.scenarios.iter().enumerate() {
            let Some((layout, _)) = study.layouts.of_scenario(&scenario.name) else { continue };
            let signature = model.built.plugin.signature(&study.context_of(&layout));
            inputs::check(study, place, &signature, &mut complaints);
            outputs::check(&layout, &signature, &mut complaints);
        }
    }
    // What is wrong in one scenario is most often wrong in all.
    problems.dedup();
    effects::check(study, root, problems);
    noise::check(study, root, problems);
    gap::check(study, root, problems);
    super::inputs::check(study, root, problems);
    super::start::check(study, root, problems);
    super::derived::check(study, root, problems);
    let is_known = problems.len() == before && quantities::check(study, root, problems);
    if problems.len() == before && is_known {
        reliability::check(study, root, problems);
    }
    each_plugin(study, root, problems, |_, component, context, complaints| {
        component.check(context, complaints);
    });
}

/// Reports a folder that `resolved.toml` cannot name: TOML is UTF-8, and without the folder a run is not resumed.
fn folder(study: &Study, complaints: &mut Complaints<'_>) {
    let folder = std::path::absolute(&study.directory).unwrap_or(study.directory.clone());
    if folder.to_str().is_none() {
        complaints
            .at("")
            .say("the study lies in a folder whose name is not UTF-8")
            .expected(
                "a folder that a TOML file can name, so that a run of the study can be resumed",
            )
            .found(folder.display());
    }
}

/// Reports sections that have no use beside `[target]`, which replaces everything that makes up a likelihood.
fn beside_a_target(study: &Study, root: &Node, complaints: &mut Complaints<'_>) {
    const ALONE: [&str; 11] = [
        "study",
        "parameter",
        "start",
        "dependence",
        "constraint",
        "derived",
        "target",
        "executor",
        "sampler",
        "quantity",
        "reliability",
    ];
    for (key, _) in root.entries().iter().filter(|(key, _)| !ALONE.contains(&key.name.as_str())) {
        complaints
            .at(&key.name)
            .say(format!("a study with `[target]` has no use for `[{}]`", key.name))
            .help("the target is the whole log density: take one of the two out");
    }
    if study.sampler.is_none() {
        complaints
            .at("")
            .say("the study has no `[sampler]`")
            .help("a target is there to be sampled: add `[sampler]`");
    }
}

/// Reports sections that are required by others and missing.
fn sections(study: &Study, complaints: &mut Complaints<'_>) {
    if study.surrogate.is_none() {
        without_surrogate(study, complaints);
    } else {
        runs_to_learn_from(study, complaints);
    }
    calibration(study, complaints);
    super::forward::check(study, complaints);
}

/// Reports what a study without a surrogate lacks: its calibration calls the model directly, and nothing is simulated
/// or read beforehand.
fn without_surrogate(study: &Study, complaints: &mut Complaints<'_>) {
    if study.model.is_none() {
        let names = registry::entries::<dyn Surrogate>().into_iter().map(|entry| entry.name);
        complaints
            .at("")
            .say("the study has neither a `[surrogate]` nor a `[model]`")
            .help(format!("add `[surrogate]`, with `use` set to {}", one_of(names)))
            .help("or add `[model]`: a study whose model is cheap needs no surrogate");
    }
    if study.measurements.is_none() && study.propagated().is_none() {
        complaints
            .at("")
            .say("the study has neither a `[surrogate]` nor `[measurements]`")
            .help("there is nothing to do: a surrogate learns from runs, a calibration from measurements")
            .help("or add `[[quantity]]` or `[forward]`: the priors are then propagated through the model");
    }
    let useless = [
        ("design", study.design.is_some()),
        ("simulations", study.simulations.is_some()),
        ("numerical_error", study.numerical_error.is_some()),
        ("low_fidelity", study.low_fidelity.is_some()),
    ];
    for (name, _) in useless.iter().filter(|(_, there)| *there) {
        complaints
            .at(name)
            .say(format!("a study without `[surrogate]` has no use for `[{name}]`"))
            .help("the calibration calls the model itself: take the section out, or add `[surrogate]`");
    }
    if study.validate.emulator_check > 0 {
        complaints
            .at("validate.emulator_check")
            .say("the study has no surrogate to check")
            .expected("a `[surrogate]` section, or `emulator_check = 0`");
    }
}

fn runs_to_learn_from(study: &Study, complaints: &mut Complaints<'_>) {
    let imported = study.simulations.as_ref().is_some_and(|s| s.built.plugin.names_files());
    let simulated = study.model.is_some() && study.design.is_some();
    if !imported && !simulated {
        complaints.at("").say("the study has no simulation runs").expected(
            "`[model]` and `[design]`, or `[simulations]` with the files of finished runs",
        );
    }
    let allowed = study.design.as_ref().is_some_and(|d| !d.common.allow_failed.is_none());
    if allowed && study.simulations.is_some() {
        complaints
            .at("design.allow_failed")
            .say("the study has a reader of its runs, which says how many may fail")
            .expected("`allow_failed` in `[simulations]`");
    }
    if study.numerical_error.is_some() && (!simulated || imported) {
        complaints
            .at("numerical_error")
            .say("the study makes no runs that could be repeated")
            .expected("`[model]` and `[design]`, and no files of finished runs in `[simulations]`");
    }
    let cheap_model = study.low_fidelity.as_ref().is_some_and(LowFidelity::is_run);
    if cheap_model && (study.design.is_none() || imported) {
        complaints
            .at("low_fidelity")
            .say("the study makes no runs that could be made at lower cost")
            .expected("`[model]` and `[design]`, or `simulations` in place of `model` and `runs`");
    }
}

fn calibration(study: &Study, complaints: &mut Complaints<'_>) {
    let calibration = [
        ("measurements", study.measurements.is_some()),
        ("discrepancy", study.discrepancy.is_some()),
        ("sampler", study.sampler.is_some()),
    ];
    if calibration.iter().any(|(_, there)| *there) {
        for (name, _) in calibration.iter().filter(|(_, there)| !there) {
            complaints
                .at("")
                .say(format!("the study has no `[{name}]`"))
                .help("a calibration needs `[measurements]`, `[discrepancy]` and `[sampler]`");
        }
    }
}

fn parameters(study: &Study, complaints: &mut Complaints<'_>) {
    let bulks = bulks(study);
    for (i, parameter) in study.parameters.iter().enumerate() {
        if study.parameters[..i].iter().any(|other| other.name == parameter.name) {
            complaints
                .at(&format!("parameter.{}.name", parameter.name))
                .say(format!("there are two parameters `{}`", parameter.name))
                .help("give each `[[parameter]]` its own name");
        }
        if study.surrogate.is_some() && !study.unknowns[i].of_population() {
            let population = study.dependence.population_of(i);
            let path = match population {
                Some(population) => format!("parameter.{}.population", population.name),
                None => format!("parameter.{}.prior", parameter.name),
            };
            // Members differ by their group only.
            if population.is_none_or(|population| population.members[0] == i) {
                let interval = study.unknowns[i].interval;
                inside_design(parameter, bulks[i], interval, &path, complaints);
            }
        }
        if let Some(value) = parameter.reference.filter(|value| !value.is_finite()) {
            complaints
                .at(&format!("parameter.{}.reference", parameter.name))
                .say("the reference is not a number")
                .expected("a finite number")
                .found(value);
        }
    }
}

/// Draws of a prior with constraints from which the central 95 % of each parameter is taken.
const DRAWS: u64 = 4000;

/// Central 95 % of the prior of each parameter, and the whole of an interval: by draws if constraints change it.
fn bulks(study: &Study) -> Vec<[f64; 2]> {
    let tails = [0.025, 0.975];
    if study.dependence.constraints.is_empty() {
        let ends = |(p, unknown): (&Parameter, &Unknown)| {
            let (low, high) = p.prior.support();
            if unknown.interval { [low, high] } else { tails.map(|t| p.prior.quantile(t)) }
        };
        return study.parameters.iter().zip(&study.unknowns).map(ends).collect();
    }
    let stream = Stream::root(study.about.seed).named("prior");
    let draw = |i: u64| study.prior().sample(&mut stream.at(i).generator());
    let draws: Vec<Vec<f64>> = (0..DRAWS).map(draw).collect();
    let of = |j: usize| {
        let values: Vec<f64> = draws.iter().map(|point| point[j]).collect();
        let sorted = moments::sorted(&values);
        tails.map(|t| moments::quantile(&sorted, t))
    };
    (0..study.parameters.len()).map(of).collect()
}

/// Reports a prior that extends beyond its design: an emulator is trained inside the design and would have to
/// extrapolate.
fn inside_design(
    parameter: &Parameter,
    bulk: [f64; 2],
    interval: bool,
    path: &str,
    complaints: &mut Complaints<'_>,
) {
    let (low, high) = parameter.design.support();
    let (what, share) =
        if interval { ("interval", "all of it") } else { ("prior", "95 % of the prior") };
    if bulk[0] < low || bulk[1] > high {
        complaints
            .at(path)
            .say(format!("the {what} of `{}` reaches beyond its design", parameter.name))
            .expected(format!("{share} inside [{low}, {high}]"))
            .found(format!("[{}, {}]", bulk[0], bulk[1]))
            .help("widen `design`: outside it the surrogate has no runs to learn from");
    }
}

fn runs(study: &Study, complaints: &mut Complaints<'_>) {
    let (Some(design), Some(surrogate)) = (&study.design, &study.surrogate) else { return };
    let imported = study.simulations.as_ref().is_some_and(|s| s.built.plugin.names_files())
        || !design.common.imports.is_empty();
    let (runs, kept) = (design.common.total(), surrogate.common.validation);
    let training = surrogate.common.training.map_or(1, usize::from);
    if !imported && training.saturating_add(kept) > runs {
        let key = if surrogate.common.training.is_some() { "training" } else { "validation" };
        complaints
            .at(&format!("surrogate.{key}"))
            .say("more runs for training and validation than the design makes")
            .expected(format!("at most {runs} together"))
            .found(training.saturating_add(kept));
    }
}

fn validation(study: &Study, complaints: &mut Complaints<'_>) {
    if study.validate.rerun_model == Some(true) && study.model.is_none() {
        complaints
            .at("validate.rerun_model")
            .say("the study has no model to run again")
            .expected("a `[model]` section, or `rerun_model = false`");
    }
    if study.validate.emulator_check > 0 && study.model.is_none() {
        complaints
            .at("validate.emulator_check")
            .say("the study has no model to check the emulator against")
            .expected("a `[model]` section, or `emulator_check = 0`");
    }
    if study.validate.against.is_some() {
        let scale = |j: usize| study.dependence.populations.iter().any(|p| p.scale == j);
        let without = study.parameters.iter().enumerate().filter(|(_, p)| p.reference.is_none());
        for (_, parameter) in without.filter(|(j, _)| !scale(*j) && !study.unknowns[*j].of_field())
        {
            complaints
                .at("validate.against")
                .say(format!("the parameter `{}` has no `reference`", parameter.name))
                .expected("a `reference` for every parameter");
        }
    }
}

/// The sections whose plugins see the response to one scenario.
const OF_RECORDS: [&str; 6] = [
    "model",
    "numerical_error",
    "low_fidelity",
    "low_fidelity.simulations",
    "simulations",
    "measurements",
];

/// The sections whose plugins see the parameters and conditions of the runs.
const OF_RUNS: [&str; 5] = ["design", "executor", "cases", "simulations", "surrogate"];

/// Calls `look` for every plugin with complaints about its own section.
pub(super) fn each_plugin(
    study: &Study,
    root: &Node,
    problems: &mut Problems,
    look: impl Fn(&str, &dyn Component, &Context<'_>, &mut Complaints<'_>),
) {
    let whole = study;
    let records_of = |study: &Study| -> Vec<Layout> {
        let of_scenario = |scenario: &Scenario| Some(study.layouts.of_scenario(&scenario.name)?.0);
        study.scenarios.iter().filter_map(of_scenario).collect()
    };
    let [records, of_runs] = [study, study.trained()].map(records_of);
    let unwritten = Node::table(root.place.clone());
    let elements = |list: &str| root.find(list).map(Node::elements).unwrap_or_default().iter();
    let (mut effects, mut candidates) = (elements("effect"), elements("gap.candidate"));
    let (mut quantities, mut rare) = (elements("quantity"), elements("reliability"));
    let all = study.components().into_iter().chain(study.of_other_cost()).chain(study.tried());
    for Chosen { section, plugin, .. } in all {
        let node = match section {
            "effect" => effects.next(),
            "quantity" => quantities.next(),
            "reliability" => rare.next(),
            "gap.candidate" => candidates.next(),
            _ => root.find(section),
        };
        // Runs and emulator know no groups.
        let study = if OF_RUNS.contains(&section) { whole.trained() } else { whole };
        let layouts = match section {
            "simulations" => &of_runs,
            _ if OF_RECORDS.contains(&section) => &records,
            _ => &study.layouts.blocks,
        };
        for layout in layouts {
            let before = problems.len();
            problems.within(section, |problems| {
                let complaints = &mut Complaints::new(node.unwrap_or(&unwritten), problems);
                look(section, plugin, &study.context_of(layout), complaints);
            });
            // What is wrong for one shape is most often wrong for all.
            if problems.len() > before {
                break;
            }
        }
    }
}

//! Command `plugins test`: the contracts of the kinds, applied to the plugins of a file.
#![allow(
    clippy::redundant_closure,
    reason = "a suite takes a trait object of one lifetime, and the closure that calls it of any"
)]

use std::path::{Path, PathBuf};

use lacuna::data::{Axis, Layout, Parameter, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::registry::{Built, Kind, from_text};
use lacuna::plugin::{
    Component, Context, Design, Discrepancy, Effect, Given, Model, Quantity, Reader, Sampler,
    Surrogate,
};
use lacuna_contract::Sample;
use lacuna_engine::host::library;

use crate::study::Settings;
use crate::{misuse, print};

/// A file of plugins and how they are tested.
#[derive(clap::Args)]
pub struct Test {
    /// Library or Python file; its code is executed
    file: PathBuf,
    /// Give an option of a plugin, such as `sampler.random_walk.steps=500`; may be repeated
    #[arg(long = "set", value_name = "KIND.NAME.KEY=VALUE")]
    set: Vec<String>,
    /// Test only this plugin, such as `sampler.random_walk`; may be repeated
    #[arg(long, value_name = "KIND.NAME")]
    only: Vec<String>,
    /// Inputs that a model gets which takes those of the study
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',', default_value = "a,b")]
    inputs: Vec<String>,
    /// Test the model as this study uses it, with its options, inputs and response
    #[arg(long, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// CSV table that a reader reads, with the columns `sensor`, `time` and `strain`
    /// (default: one of two sensors and three times, called `sample.csv`)
    #[arg(long, value_name = "FILE")]
    sample: Option<PathBuf>,
}

/// Breaches of a contract, or why a plugin cannot be tested.
type Outcome = Result<(), Vec<String>>;

/// Runs `lacuna plugins test FILE`.
pub fn run(asked: &Test) -> anyhow::Result<()> {
    let path = asked.file.display();
    let loaded = library::load(&asked.file, None).map_err(|reason| {
        misuse(format!("error: the plugins of {path} cannot be used: {reason}"))
    })?;
    let all: Vec<String> =
        loaded.plugins.iter().map(|(kind, name)| format!("{kind}.{name}")).collect();
    for text in asked.only.iter().chain(&asked.set) {
        if !all.iter().any(|name| text == name || text.starts_with(&format!("{name}."))) {
            let known = all.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            return Err(misuse(format!(
                "error: `{text}` names no plugin of {path}: it has {known}"
            )));
        }
    }
    let mut failed = 0;
    for (kind, name) in &loaded.plugins {
        let full = format!("{kind}.{name}");
        if !asked.only.is_empty() && !asked.only.contains(&full) {
            continue;
        }
        let breaches = asked.judged(kind, name)?.err().unwrap_or_default();
        if breaches.is_empty() {
            print(&format!("{full}  keeps its contract"));
            continue;
        }
        failed += 1;
        print(&format!("{full}  BREAKS its contract"));
        for breach in breaches {
            print(&format!("  {breach}"));
        }
    }
    match failed {
        0 => Ok(()),
        1 => Err(anyhow::anyhow!("1 plugin breaks its contract")),
        _ => Err(anyhow::anyhow!("{failed} plugins break their contracts")),
    }
}

impl Test {
    /// Options of a plugin, as a study writes them.
    fn options(&self, kind: &str, name: &str) -> String {
        let prefix = format!("{kind}.{name}.");
        let own = self.set.iter().filter_map(|text| text.strip_prefix(&prefix));
        own.map(|text| format!("{text}\n")).collect()
    }

    fn judged(&self, kind: &str, name: &str) -> anyhow::Result<Outcome> {
        let folder = tempfile::tempdir()?;
        let options = self.options(kind, name);
        Ok(match kind {
            "design" => suite::<dyn Design>(name, &options, |n, p| lacuna_contract::design(n, p)),
            "discrepancy" => {
                suite::<dyn Discrepancy>(name, &options, |n, p| lacuna_contract::discrepancy(n, p))
            }
            "effect" => suite::<dyn Effect>(name, &options, |n, p| lacuna_contract::effect(n, p)),
            "quantity" => {
                suite::<dyn Quantity>(name, &options, |n, p| lacuna_contract::quantity(n, p))
            }
            "surrogate" => {
                suite::<dyn Surrogate>(name, &options, |n, p| lacuna_contract::surrogate(n, p))
            }
            "sampler" => sampler(name, &options),
            "model" if self.study.is_some() => self.model_of_study(name, folder.path())?,
            "model" => suite::<dyn Model>(name, &options, |name, plugin| {
                self.model(name, plugin, folder.path())
            }),
            "reader" => suite::<dyn Reader>(name, &options, |name, plugin| {
                self.reader(name, plugin, folder.path())
            }),
            kind => Err(vec![format!("there is no suite for plugins of the kind `{kind}`")]),
        })
    }

    /// The suite of models, with the options, the inputs and the first response of the study.
    fn model_of_study(&self, name: &str, folder: &Path) -> anyhow::Result<Outcome> {
        let path = self.study.as_deref().unwrap_or(Path::new(""));
        let study = crate::study::load(path, &Settings::default())?;
        let used = study.model.as_ref().filter(|model| model.built.name == name);
        let Some(model) = used else {
            let what = format!("{} does not use the model `{name}`", path.display());
            return Ok(Err(vec![what]));
        };
        let scenario = study.scenarios.first().map_or("", |scenario| scenario.name.as_str());
        let Some((layout, _)) = study.layouts.of_scenario(scenario) else {
            return Ok(Err(vec![format!("{} has no response", path.display())]));
        };
        let context = study.context_of(&layout);
        let judged = lacuna_contract::model(name, &*model.built.plugin, &context, folder);
        let mut breaches = judged.err().unwrap_or_default();
        breaches.extend(faults(&model.built));
        Ok(if breaches.is_empty() { Ok(()) } else { Err(breaches) })
    }

    /// The suite of models, in a study of the inputs and five times.
    fn model(&self, name: &str, plugin: &dyn Model, folder: &Path) -> Outcome {
        let parameter = |name: &String| Parameter::plain(name, Distribution::Uniform([0.0, 2.0]));
        let parameters: Vec<Parameter> = self.inputs.iter().map(parameter).collect();
        let given: Vec<Given> = (parameters.iter())
            .map(|p| Given { name: p.name.clone(), unit: Some(p.unit.clone()) })
            .collect();
        let (scenarios, layout) = ([Scenario::default()], times());
        let context = Context {
            given: &given,
            scenarios: &scenarios,
            ..Context::new(folder, &parameters, &layout)
        };
        lacuna_contract::model(name, plugin, &context, folder)
    }

    fn reader(&self, name: &str, plugin: &dyn Reader, folder: &Path) -> Outcome {
        let sample = sample(self.sample.as_deref(), folder).map_err(|reason| vec![reason])?;
        lacuna_contract::reader(name, plugin, &sample, folder)
    }
}

/// Builds a plugin and runs it through a suite; a fault that the suite did not see is a breach too.
fn suite<K: Kind + Component + ?Sized>(
    name: &str,
    options: &str,
    judge: impl Fn(&str, &K) -> Outcome,
) -> Outcome {
    let built =
        from_text::<K>(name, options).map_err(|problem| vec![with_help::<K>(name, &problem)])?;
    let mut breaches = judge(name, &*built.plugin).err().unwrap_or_default();
    breaches.extend(faults(&built));
    if breaches.is_empty() { Ok(()) } else { Err(breaches) }
}

fn faults<K: Kind + Component + ?Sized>(built: &Built<K>) -> Vec<String> {
    let all = built.plugin.faults();
    all.iter().filter_map(|fault| fault.said()).map(|said| format!("fault: {said}")).collect()
}

fn with_help<K: Kind + ?Sized>(name: &str, problem: &str) -> String {
    let kind = K::NAME;
    format!("{}\n  help: give its options with `--set {kind}.{name}.KEY=VALUE`", problem.trim_end())
}

/// The suite of samplers. An ensemble is also tested with few walkers, if an option sets their number: what a walker does
/// with itself as a partner shows there and hides among many.
fn sampler(name: &str, options: &str) -> Outcome {
    suite::<dyn Sampler>(name, options, |name, plugin| lacuna_contract::sampler(name, plugin))?;
    match small(name, options) {
        Some((label, options)) => suite::<dyn Sampler>(name, &options, |_, plugin| {
            lacuna_contract::sampler(&label, plugin)
        }),
        None => Ok(()),
    }
}

/// Fewest walkers with which an ensemble is tested in two dimensions.
const FEW: [i64; 4] = [6, 8, 10, 12];

/// Options with which the number of walkers is small, and the name of the sampler with them.
fn small(name: &str, options: &str) -> Option<(String, String)> {
    let build = |options: &str| from_text::<dyn Sampler>(name, options).ok();
    let built = build(options)?;
    let plan = built.plugin.plan(2);
    let chains = i64::try_from(plan.chains).ok()?;
    let sets = |(_, value): &(&String, &toml::Value)| value.as_integer() == Some(chains);
    let (key, _) = built.options.iter().filter(|_| plan.ensemble).find(sets)?;
    let without: String = (options.lines())
        .filter(|line| line.split('=').next().map(str::trim) != Some(key))
        .map(|line| format!("{line}\n"))
        .collect();
    FEW.into_iter().filter(|few| *few < chains).find_map(|few| {
        let options = format!("{without}{key} = {few}\n");
        let fits = build(&options)?.plugin.plan(2).chains == usize::try_from(few).ok()?;
        fits.then(|| (format!("{name} {key} = {few}"), options))
    })
}

fn times() -> Layout {
    let seconds = Unit::parse("s").unwrap_or_else(|_| unreachable!("`s` is a unit"));
    let axes = vec![Axis::grid("time", (1..=5).map(f64::from).collect(), seconds)];
    Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes }
}

/// A table and what stands in it.
fn sample(given: Option<&Path>, folder: &Path) -> Result<Sample, String> {
    let seconds = Unit::parse("s").unwrap_or_else(|_| unreachable!("`s` is a unit"));
    let axes =
        vec![Axis::labels("sensor", ["A", "B"]), Axis::grid("time", vec![1.0, 2.0, 3.0], seconds)];
    let layout = Layout { name: "strain".to_owned(), unit: Unit::dimensionless(), axes };
    let values = vec![0.5, -1.0, 2.0, 3.25, 4.0, 5.5];
    let row = |i: usize| format!("{},{},{}\n", ["A", "B"][i / 3], 1 + i % 3, values[i]);
    let file = match given {
        Some(file) => file.to_owned(),
        None => folder.join("sample.csv"),
    };
    if given.is_none() {
        let rows: String = (0..6).map(row).collect();
        std::fs::write(&file, format!("sensor,time,strain\n{rows}"))
            .map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    }
    Ok(Sample { file, layout, values, tolerance: 0.0 })
}

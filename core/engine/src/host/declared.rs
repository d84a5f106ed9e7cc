//! Plugins that stand for those of a library that is looked at without being loaded.
//!
//! They take any options and complain of nothing, so that the rest of a study can be checked; used, they stop.

use std::path::{Path, PathBuf};

use lacuna::data::Layout;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::quantity::{Arguments, Functional, Misfit};
use lacuna::plugin::reader::{Contents, ReadError};
use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::plugin::registry::{Built, Entry, Kind, find};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{
    Component, Context, Design, Discrepancy, Effect, Emulator, Hyperparameter, Library, Likelihood,
    Model, Quantity, Reader, Sampler, Surrogate, Target,
};
use lacuna::run::{Progress, Stop};
use lacuna::text::{Node, Problems};
use lacuna_abi::wire::{self, SignatureAbout};
use lacuna_linalg::Matrix;
use serde_json::json;
use toml::Table;

/// A plugin of a library that was not loaded.
struct Absent;

/// The plugins that a library is said to hold, by kind and name; those of kinds that this program does not know, and those
/// that are there already, are left out. A library that made a finished run, and is gone, lends them its identity.
pub fn entries(
    path: &Path,
    plugins: &[(String, String)],
    library: Option<&'static Library>,
) -> Vec<AnyEntry> {
    let plugins = plugins.iter();
    plugins.filter_map(|(kind, name)| of_kind((path, library), kind, name)).collect()
}

/// The file of a plugin, and the library that it was.
type From<'a> = (&'a Path, Option<&'static Library>);

fn of_kind(path: From<'_>, kind: &str, name: &str) -> Option<AnyEntry> {
    match kind {
        "design" => entry::<dyn Design>(path, name, || Box::new(Absent)),
        "discrepancy" => entry::<dyn Discrepancy>(path, name, || Box::new(Absent)),
        "effect" => entry::<dyn Effect>(path, name, || Box::new(Absent)),
        "model" => entry::<dyn Model>(path, name, || Box::new(Absent)),
        "quantity" => entry::<dyn Quantity>(path, name, || Box::new(Absent)),
        "reader" => entry::<dyn Reader>(path, name, || Box::new(Absent)),
        "surrogate" => entry::<dyn Surrogate>(path, name, || Box::new(Absent)),
        "sampler" => entry::<dyn Sampler>(path, name, || Box::new(Absent)),
        _ => None,
    }
}

fn entry<K: Kind + ?Sized>(
    (path, library): From<'_>,
    name: &str,
    make: fn() -> Box<K>,
) -> Option<AnyEntry> {
    if find::<K>(name).is_ok() {
        return None;
    }
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    let build = move |node: &Node, _: &[&str], _: &mut Problems| {
        let options = wire::json_of_node(node);
        let options = options.as_object().map(wire::table_of_json).unwrap_or_default();
        Some(Built { name, plugin: make(), options, library, revision: 1 })
    };
    let entry: &'static Entry<K> = Box::leak(Box::new(Entry {
        name,
        aliases: &[],
        schema: &|_| schemars::Schema::try_from(json!({ "type": "object" })).unwrap_or_default(),
        build: Box::leak(Box::new(build)),
        module_path: Box::leak(path.display().to_string().into_boxed_str()),
        version: "",
        revision: 1,
        library,
    }));
    Some(entry)
}

fn stop() -> Stop {
    Stop::new("the library that holds the plugin was not loaded")
}

impl Component for Absent {}

impl Discrepancy for Absent {
    fn likelihood(&self, _: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Err(stop())
    }

    /// A library that is not loaded cannot be asked, so that data that state their noise are right.
    fn takes_stated_noise(&self) -> bool {
        true
    }
}

impl Sampler for Absent {
    fn plan(&self, _: usize) -> Plan {
        Plan { chains: 1, steps: 1, warm_up: 0, ensemble: false }
    }

    fn start(&self, _: &dyn Target, _: Matrix) -> Result<State, Stop> {
        Err(stop())
    }

    fn step(&self, _: &dyn Target, _: &mut State, _: &Stream) -> Result<(), Stop> {
        Err(stop())
    }
}

impl Design for Absent {
    fn points(&self, _: usize, _: usize, _: &Stream) -> Result<Matrix, Stop> {
        Err(stop())
    }
}

impl Surrogate for Absent {
    fn fit(
        &self,
        _: &Training<'_>,
        _: &Stream,
        _: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Err(stop())
    }

    fn load(&self, _: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Err(stop())
    }
}

impl Model for Absent {
    /// Accepts whatever the study gives: the inputs are not known.
    fn signature(&self, context: &Context<'_>) -> Signature {
        SignatureAbout::default().in_study(context)
    }

    fn predict(&self, _: &Call<'_>) -> Result<Response, EvalError> {
        Err(EvalError::Fatal(stop().message))
    }
}

impl Quantity for Absent {
    /// Neither a quantity nor a misfit: nothing is known of it.
    fn bind(&self, _: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        Err(Vec::new())
    }
}

impl Reader for Absent {
    fn recognises(&self, _: &Path, _: &[u8]) -> bool {
        false
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        Err(ReadError::new(path, stop().message))
    }

    fn names_files(&self) -> bool {
        true
    }

    fn files(&self, _: &Path, _: Option<&str>) -> Vec<PathBuf> {
        Vec::new()
    }
}

impl Effect for Absent {
    fn describe(&self) -> Description {
        Description { title: String::new(), formula: String::new(), source: String::new() }
    }

    fn parameters(&self, _: &Layout) -> Vec<Hyperparameter> {
        Vec::new()
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        Vec::new()
    }

    fn apply(&self, _: &Layout, response: &[f64], _: &[f64]) -> Vec<f64> {
        response.to_vec()
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        Vec::new()
    }

    fn proposals(&self, _: &Situation<'_>) -> Vec<Table> {
        Vec::new()
    }
}

//! Command `serve`: a study's functions as UM-Bridge models.

use std::net::IpAddr;
use std::path::Path;

use lacuna::plugin::model::EvalError;
use lacuna::run::Stop;
use lacuna_engine::serve::{Derivatives, Function, curvature, finished, functions};
use lacuna_engine::study::resolve::Use;
use lacuna_um_bridge::protocol::{Config, Fault, INTERNAL_ERROR, INVALID_INPUT, Support};
use lacuna_um_bridge::{Model, Server};

use crate::study::{Settings, folder, load, load_for};
use crate::{interrupt, print, progress};

/// Address at which the server listens.
#[derive(clap::Args)]
pub struct Place {
    /// Port; 0 takes any free port and prints it
    #[arg(long, value_name = "N", default_value_t = 4242)]
    port: u16,
    /// Address to listen at; `0.0.0.0` makes the server available to other machines
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: IpAddr,
}

/// Runs `lacuna serve STUDY`.
pub fn serve(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    place: &Place,
) -> anyhow::Result<()> {
    let study = load_for(path, settings, Use::Look)?;
    // The port is bound first, so that an occupied port is reported before any expensive work.
    let server = Server::bind(place.host, place.port).map_err(|error| {
        let Place { host, port } = place;
        Stop::new(format!("cannot listen at {host}, port {port}: {error}"))
            .help("choose another port with `--port N`")
    })?;
    let directory = folder(&study, out);
    let run = finished(&study, &directory)?;
    if run.is_none() || (study.surrogate.is_none() && study.target.is_none()) {
        // In these cases the model itself will be evaluated, so it must be available.
        load(path, settings)?;
    }
    if run.is_none() && out.is_some() {
        let message = format!("there is no finished run in {}", directory.display());
        return Err(Stop::new(message).help("run the study first, or leave `--out` out").into());
    }
    if run.is_none() && study.target.is_none() {
        let directory = directory.display();
        print(&format!("no finished run in {directory}: the model alone is served"));
    }
    let stopper = server.stopper();
    interrupt::when_asked(move |_| stopper.stop())
        .map_err(|error| Stop::new(format!("cannot wait for Ctrl-C: {error}")))?;
    let answered = functions(&study, run, &*progress::observer(), |functions| {
        let functions: Vec<_> = functions.iter().filter(|function| !function.is_local()).collect();
        for function in &functions {
            print(&described(**function));
        }
        print(&format!("listening at http://{}; Ctrl-C ends it", server.address()));
        let bridged: Vec<Bridged<'_>> = functions.iter().map(|f| Bridged(**f)).collect();
        let models: Vec<&dyn Model> = bridged.iter().map(|b| b as &dyn Model).collect();
        server.serve(&models, rayon::current_num_threads())
    })?;
    print(&format!("stopped after {answered} questions"));
    Ok(())
}

/// Description of a function, in one line.
fn described(function: &dyn Function) -> String {
    let variables: Vec<String> =
        function.variables().iter().map(|v| format!("{} [{}]", v.name, v.unit)).collect();
    let outputs = match function.outputs() {
        1 => "1 value".to_owned(),
        n => format!("{n} values"),
    };
    let parts = function.scenarios().iter();
    let parts: Vec<String> =
        parts.map(|p| format!("`{}` {}", p.scenario, p.outputs.len())).collect();
    let parts = if parts.is_empty() { String::new() } else { format!(": {}", parts.join(", ")) };
    format!("`{}`: {} -> {outputs}{parts}", function.name(), variables.join(", "))
}

/// A function as a UM-Bridge model with one input and one output vector.
struct Bridged<'a>(&'a dyn Function);

impl Bridged<'_> {
    fn derivatives(&self) -> Result<&dyn Derivatives, Fault> {
        let none = || Fault::new(INTERNAL_ERROR, "this function has no derivatives");
        self.0.derivatives().ok_or_else(none)
    }
}

/// Fault for an evaluation that failed, or for a model that can no longer answer.
fn fault(error: EvalError) -> Fault {
    match error {
        EvalError::Rejected(reason) => Fault::new(INVALID_INPUT, reason),
        EvalError::Fatal(reason) => Fault::new(INTERNAL_ERROR, reason),
    }
}

/// Setting by which a client requests one scenario.
const SCENARIO: &str = "scenario";

/// Index of the scenario that the settings request; no other setting is allowed.
fn scenario(function: &dyn Function, config: &Config) -> Result<Option<usize>, Fault> {
    let wrong = |text: String| Err(Fault::new(INVALID_INPUT, text));
    let known = function.scenarios();
    if let Some(key) = config.keys().find(|key| known.is_empty() || *key != SCENARIO) {
        return wrong(format!("there is no setting `{key}`"));
    }
    let Some(value) = config.get(SCENARIO) else { return Ok(None) };
    let place = known.iter().position(|part| value.as_str() == Some(&part.scenario));
    if place.is_none() {
        let names: Vec<String> = known.iter().map(|p| format!("`{}`", p.scenario)).collect();
        return wrong(format!(
            "there is no scenario {value}, expected one of {}",
            names.join(", ")
        ));
    }
    Ok(place)
}

impl Model for Bridged<'_> {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn support(&self) -> Support {
        let derivatives = self.0.derivatives();
        Support {
            evaluate: true,
            gradient: derivatives.is_some(),
            apply_jacobian: derivatives.is_some(),
            apply_hessian: derivatives.is_some_and(|d| d.scales().is_some()),
        }
    }

    fn input_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault> {
        scenario(self.0, config)?;
        Ok(vec![self.0.variables().len()])
    }

    fn output_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault> {
        let all = || self.0.outputs();
        let of = |i: usize| self.0.scenarios()[i].outputs.len();
        Ok(vec![scenario(self.0, config)?.map_or_else(all, of)])
    }

    fn evaluate(&self, input: &[Vec<f64>], config: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        let scenario = scenario(self.0, config)?;
        self.0.values(&input[0], scenario).map(|values| vec![values]).map_err(fault)
    }

    fn gradient(
        &self,
        _: usize,
        _: usize,
        input: &[Vec<f64>],
        sens: &[f64],
        config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let scenario = scenario(self.0, config)?;
        let jacobian = self.derivatives()?.jacobian(&input[0], scenario).map_err(fault)?;
        Ok(lacuna::matrix::transposed_multiply_vector(&jacobian, sens))
    }

    fn apply_jacobian(
        &self,
        _: usize,
        _: usize,
        input: &[Vec<f64>],
        vec: &[f64],
        config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let scenario = scenario(self.0, config)?;
        let jacobian = self.derivatives()?.jacobian(&input[0], scenario).map_err(fault)?;
        Ok(lacuna::matrix::multiply_vector(&jacobian, vec))
    }

    fn apply_hessian(
        &self,
        _: usize,
        _: [usize; 2],
        input: &[Vec<f64>],
        sens: &[f64],
        vec: &[f64],
        config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let scenario = scenario(self.0, config)?;
        let rough = || Fault::new(INTERNAL_ERROR, "this function has no second derivatives");
        let second = curvature(self.derivatives()?, &input[0], scenario, sens, vec);
        second.ok_or_else(rough)?.map_err(fault)
    }
}

//! `serve`: a study's functions as UM-Bridge models.

use std::net::IpAddr;
use std::path::Path;

use lacuna::plugin::model::EvalError;
use lacuna::run::Stop;
use lacuna::serve::{Derivatives, Function, curvature, finished, functions};
use lacuna::study::resolve::Use;
use lacuna_um_bridge::protocol::{Config, Fault, INTERNAL_ERROR, INVALID_INPUT, Support};
use lacuna_um_bridge::{Model, Server};

use crate::progress::Terminal;
use crate::study::{Settings, folder, load, load_for};
use crate::{Failure, print};

/// Where the server listens.
#[derive(clap::Args)]
pub struct Place {
    /// The port; 0 takes any that is free and says which.
    #[arg(long, value_name = "N", default_value_t = 4242)]
    port: u16,
    /// The address to listen at; `0.0.0.0` lets other machines ask too.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: IpAddr,
}

/// `lacuna serve STUDY`
pub fn serve(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    place: &Place,
) -> Result<(), Failure> {
    let study = load_for(path, settings, Use::Look)?;
    // First of all, because a port that is taken should not be found out after everything else.
    let server = Server::bind(place.host, place.port).map_err(|error| {
        let Place { host, port } = place;
        Stop::new(format!("cannot listen at {host}, port {port}: {error}"))
            .help("choose another port with `--port N`")
    })?;
    let directory = folder(&study, out);
    let run = finished(&study, &directory)?;
    if run.is_none() || (study.surrogate.is_none() && study.target.is_none()) {
        // Then the model will be asked, so that it has to be there.
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
    ctrlc::set_handler(move || stopper.stop())
        .map_err(|error| Stop::new(format!("cannot wait for Ctrl-C: {error}")))?;
    let answered = functions(&study, run, &Terminal::new(), |functions| {
        for function in functions {
            print(&described(*function));
        }
        print(&format!("listening at http://{}; Ctrl-C ends it", server.address()));
        let bridged: Vec<Bridged<'_>> = functions.iter().map(|f| Bridged(*f)).collect();
        let models: Vec<&dyn Model> = bridged.iter().map(|b| b as &dyn Model).collect();
        server.serve(&models, rayon::current_num_threads())
    })?;
    print(&format!("stopped after {answered} questions"));
    Ok(())
}

/// One line about a function.
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

/// A function as a model of one input and one output vector.
struct Bridged<'a>(&'a dyn Function);

impl Bridged<'_> {
    fn derivatives(&self) -> Result<&dyn Derivatives, Fault> {
        let none = || Fault::new(INTERNAL_ERROR, "this function has no derivatives");
        self.0.derivatives().ok_or_else(none)
    }
}

/// A question that has no answer, or a model that has none any more.
fn fault(error: EvalError) -> Fault {
    match error {
        EvalError::Rejected(reason) => Fault::new(INVALID_INPUT, reason),
        EvalError::Fatal(reason) => Fault::new(INTERNAL_ERROR, reason),
    }
}

/// The setting by which one scenario is asked for.
const SCENARIO: &str = "scenario";

/// The number of the scenario that the settings ask for, the only thing that can be set.
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
        Ok(lacuna::linalg::transposed_multiply_vector(&jacobian, sens))
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
        Ok(lacuna::linalg::multiply_vector(&jacobian, vec))
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

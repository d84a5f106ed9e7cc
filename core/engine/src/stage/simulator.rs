//! The study's model as a function of the study's parameters, in the study's units.

mod asked;
mod source;

use std::ops::Range;
use std::path::{Path, PathBuf};

use lacuna::data::{Layout, Scenario, Unit};
use lacuna::math::random::Stream;
use lacuna::plugin::executor::Recipe;
use lacuna::plugin::forward::Numbers;
use lacuna::plugin::model::{Call, EvalError, Gradient, Input, Model, Response};
use lacuna::plugin::registry::Section;
use lacuna::plugin::{Context, Given};
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply};

use asked::{asked, folder, shaped};
use source::{Source, source};

use crate::study::Study;
use crate::study::file::ModelKeys;
use crate::study::inputs::Computed;

/// A model with all known inputs set, as a function of the study's parameters.
pub struct Simulator<'a> {
    /// The model.
    pub model: &'a dyn Model,
    /// Description from which another process builds the model.
    pub recipe: Recipe,
    /// Folder of the study file.
    pub study: &'a Path,
    /// Names of the model's inputs.
    pub names: Vec<String>,
    /// Units of the model's inputs.
    pub units: Vec<Unit>,
    /// One setting per scenario.
    pub settings: Vec<Setting<'a>>,
    /// Names of the coordinates of a point: the study's parameters, followed by inputs that are set free.
    pub unknowns: Vec<String>,
}

/// A model in place of the study's, with inputs that are free in addition to the study's parameters.
pub struct Other<'a> {
    /// The model.
    pub section: &'a Section<dyn Model, ModelKeys>,
    /// Inputs that are set: at least those that the study sets.
    pub given: &'a [Given],
    /// Names and units of the free inputs.
    pub free: Vec<(&'a str, &'a Unit)>,
}

/// The model under the conditions of one scenario.
pub struct Setting<'a> {
    /// Conditions of the scenario.
    pub scenario: &'a Scenario,
    /// Requested response: the study's layout in the model's units.
    pub asked: Layout,
    /// Range of its outputs among those of all scenarios.
    pub outputs: Range<usize>,
    /// Folder of its runs inside that of all runs.
    pub folder: PathBuf,
    /// Range of each input in which the model can be evaluated.
    ranges: Vec<(f64, f64)>,
    /// Source of each input's value.
    sources: Vec<Source>,
    /// Inputs that are set by expressions.
    computed: Option<Computed>,
    /// Indices of the study's parameters on which the response depends, as far as the model knows.
    used: Vec<usize>,
    /// Factor from the model's unit of the response to the study's.
    factor: f64,
    /// Random numbers of the study for runs under these conditions.
    random: Stream,
}

/// Number of different seeds: those that a signed integer of 32 bits holds, without zero.
const SEEDS: u64 = (1 << 31) - 1;

impl<'a> Simulator<'a> {
    /// The simulator of a study; `None` if it has no model.
    pub fn of(study: &'a Study) -> Result<Option<Self>, Stop> {
        study.model.as_ref().map(|section| Self::with_model(study, section)).transpose()
    }

    /// The simulator of a study with another model in place of its own.
    pub fn with_model(
        study: &'a Study,
        section: &'a Section<dyn Model, ModelKeys>,
    ) -> Result<Self, Stop> {
        Self::of_other(study, &Other { section, given: &study.given, free: Vec::new() })
    }

    /// The simulator of a study with another model, some of whose inputs are free.
    pub fn of_other(study: &'a Study, other: &Other<'a>) -> Result<Self, Stop> {
        let section = other.section;
        let model = &*section.built.plugin;
        let mut settings = Vec::new();
        let (mut names, mut units) = (Vec::new(), Vec::new());
        for (place, scenario) in study.scenarios.iter().enumerate() {
            let (layout, outputs) = study
                .layouts
                .of_scenario(&scenario.name)
                .ok_or_else(|| Stop::new(format!("no response to `{}`", scenario.name)))?;
            let context = Context { given: other.given, ..study.context_of(&layout) };
            let signature = model.signature(&context);
            let unused = model.unused(&context);
            let computed = study.computed(place).map_err(|faults| {
                let faults: Vec<String> = faults.iter().map(ToString::to_string).collect();
                Stop::new(format!("`computed` in `[model]`: {}", faults.join("; ")))
            })?;
            let source = |input: &Input| source(study, other, place, computed.as_ref(), input);
            let sources = signature.inputs.iter().map(source).collect::<Result<Vec<_>, Stop>>()?;
            let heeded = signature.inputs.iter().zip(&sources);
            let heeded = heeded.filter(|(input, _)| !unused.contains(&input.name));
            let behind = |(_, source): (&Input, &Source)| source.parameters(computed.as_ref());
            let used = heeded.flat_map(behind).collect();
            names = signature.inputs.iter().map(|input| input.name.clone()).collect();
            units = signature.inputs.iter().map(|input| input.unit.clone()).collect();
            let (asked, factor) = asked(&layout, &signature.layout)?;
            let folder = folder(place, &scenario.name);
            let ranges = signature.inputs.iter().map(|input| input.range).collect();
            let random = super::stream(study, "model").at(place as u64);
            settings.push(Setting {
                scenario,
                asked,
                outputs,
                folder,
                ranges,
                sources,
                computed,
                used,
                factor,
                random,
            });
        }
        let free = other.free.iter().map(|(name, _)| (*name).to_owned());
        let unknowns = study.parameters.iter().map(|p| p.name.clone()).chain(free).collect();
        let recipe = Recipe::of(&section.built)?;
        Ok(Self { study: &study.directory, model, recipe, names, units, settings, unknowns })
    }

    /// Returns true if the model receives a seed.
    pub fn is_stochastic(&self) -> bool {
        self.settings.iter().any(|setting| setting.seeds().next().is_some())
    }

    /// Responses to all scenarios at one point, in the study's unit.
    pub fn respond(&self, point: &[f64]) -> Result<Response, EvalError> {
        let mut all = Response { values: Vec::new(), valid: true, facts: Vec::new() };
        let outputs = self.settings.iter().map(|setting| setting.outputs.end).max();
        all.values.resize(outputs.unwrap_or(0), 0.0);
        for setting in &self.settings {
            let response = self.respond_to(setting, point)?;
            all.values[setting.outputs.clone()].copy_from_slice(&response.values);
            all.valid &= response.valid;
            all.facts.extend(response.facts);
        }
        Ok(all)
    }

    /// Response to one scenario at a point, in the study's unit.
    pub fn respond_to(&self, setting: &Setting<'_>, point: &[f64]) -> Result<Response, EvalError> {
        self.respond_on(&setting.asked, setting, point)
    }

    /// Rejects a point at which an input leaves the model's range in one of these settings.
    pub fn in_range(&self, settings: &[Setting<'_>], point: &[f64]) -> Result<(), EvalError> {
        for setting in settings {
            let inputs = setting.inputs(point);
            for ((x, (low, high)), name) in inputs.iter().zip(&setting.ranges).zip(&self.names) {
                if !(low..=high).contains(&x) {
                    return Err(EvalError::Rejected(format!(
                        "`{name}` is {x} in the model's unit, outside the model's range {low} to {high}"
                    )));
                }
            }
        }
        Ok(())
    }

    /// Indices of the study's parameters on which no response depends.
    pub fn idle(&self, parameters: usize) -> Vec<usize> {
        let used = |i: &usize| self.settings.iter().any(|setting| setting.used.contains(i));
        (0..parameters).filter(|i| !used(i)).collect()
    }

    /// Response to one scenario and its derivatives by the study's parameters (`outputs x parameters`), in the study's
    /// unit.
    pub fn with_derivatives(
        &self,
        setting: &Setting<'_>,
        gradient: &dyn Gradient,
        point: &[f64],
    ) -> Result<(Response, Matrix), EvalError> {
        self.with_derivatives_on(&setting.asked, setting, gradient, point)
    }

    /// The same on another layout than that of the setting.
    pub fn with_derivatives_on(
        &self,
        layout: &Layout,
        setting: &Setting<'_>,
        gradient: &dyn Gradient,
        point: &[f64],
    ) -> Result<(Response, Matrix), EvalError> {
        let inputs = setting.inputs(point);
        let call = Call { layout, ..self.call(setting, &inputs) };
        let (response, jacobian) = match gradient.with_response(&call) {
            Some(both) => both?,
            None => (self.model.predict(&call)?, gradient.jacobian(&call)?),
        };
        shaped(&jacobian, layout.len(), inputs.len())?;
        let response = setting.checked_on(layout, Ok(response))?;
        Ok((response, setting.by_parameters(&jacobian, point)))
    }

    /// Response to one scenario at a point on another layout than that of the setting, in the study's unit.
    pub fn respond_on(
        &self,
        layout: &Layout,
        setting: &Setting<'_>,
        point: &[f64],
    ) -> Result<Response, EvalError> {
        let inputs = setting.inputs(point);
        let call = Call { layout, ..self.call(setting, &inputs) };
        setting.checked_on(layout, self.model.predict(&call))
    }

    /// Derivatives of the response to one scenario by the study's parameters (`outputs x parameters`), in the study's
    /// unit.
    pub fn jacobian(
        &self,
        setting: &Setting<'_>,
        gradient: &dyn Gradient,
        point: &[f64],
    ) -> Result<Matrix, EvalError> {
        let inputs = setting.inputs(point);
        let jacobian = gradient.jacobian(&self.call(setting, &inputs))?;
        shaped(&jacobian, setting.asked.len(), inputs.len())?;
        Ok(setting.by_parameters(&jacobian, point))
    }

    /// Call of the model for one scenario, without files that are kept.
    pub fn call<'b>(&'b self, setting: &'b Setting<'_>, inputs: &'b [f64]) -> Call<'b> {
        Call {
            inputs,
            names: &self.names,
            units: &self.units,
            layout: &setting.asked,
            scenario: setting.scenario,
            study: self.study,
            directory: None,
        }
    }
}

impl Setting<'_> {
    /// Inputs of the model at one point of the study's parameters; of a stochastic model, those of the point's first run.
    pub fn inputs(&self, point: &[f64]) -> Vec<f64> {
        self.inputs_of_run(point, 0, Numbers::OfPoint)
    }

    /// Inputs of the run with this number at one point of the study's parameters.
    pub fn inputs_of_run(&self, point: &[f64], run: u64, numbers: Numbers) -> Vec<f64> {
        let mut inputs = self.inputs_without_seed(point);
        for place in self.seeds() {
            inputs[place] = self.seed(&inputs, run, numbers);
        }
        inputs
    }

    /// Key of the stream from which the seeds of runs are made; `None` if the model receives none.
    pub fn seeds_of(&self) -> Option<[u64; 4]> {
        self.seeds().next().map(|_| self.random.key())
    }

    /// Indices of the inputs that receive the seed.
    fn seeds(&self) -> impl Iterator<Item = usize> {
        let sources = self.sources.iter().enumerate();
        sources.filter(|(_, source)| matches!(source, Source::Seed)).map(|(place, _)| place)
    }

    /// Seed of a run with these inputs.
    fn seed(&self, inputs: &[f64], run: u64, numbers: Numbers) -> f64 {
        let stream = match numbers {
            Numbers::OfPoint => {
                let own = self.random.named("point");
                inputs.iter().fold(own, |stream, input| stream.at(input.to_bits()))
            }
            Numbers::Common(set) => self.random.named("common").at(set),
        };
        let word = stream.at(run).key()[0];
        (1 + word % SEEDS) as f64
    }

    /// Inputs with zero in place of the seed.
    fn inputs_without_seed(&self, point: &[f64]) -> Vec<f64> {
        let computed = self.computed.as_ref().map(|computed| {
            let unknowns: Vec<f64> = computed.parameters.iter().map(|&i| point[i]).collect();
            computed.program.value(&unknowns)
        });
        let value = |source: &Source| match source {
            Source::Fixed(value) => *value,
            Source::Seed => 0.0,
            Source::Parameter(i, factor) => point[*i] * factor,
            Source::Computed(i, factor) => {
                computed.as_ref().map_or(f64::NAN, |values| values[*i] * factor)
            }
        };
        self.sources.iter().map(value).collect()
    }

    /// Derivative of each input by each parameter of the study, `inputs x parameters`.
    pub fn slopes(&self, point: &[f64]) -> Matrix {
        let computed = self.computed.as_ref().map(|computed| {
            let unknowns: Vec<f64> = computed.parameters.iter().map(|&i| point[i]).collect();
            (computed, computed.program.jacobian(&unknowns).1)
        });
        let mut slopes = Matrix::zeros(self.sources.len(), point.len());
        for (row, source) in self.sources.iter().enumerate() {
            match (source, &computed) {
                (Source::Parameter(i, factor), _) => slopes[(row, *i)] = *factor,
                (Source::Computed(k, factor), Some((computed, jacobian))) => {
                    for (column, &i) in computed.parameters.iter().enumerate() {
                        slopes[(row, i)] = jacobian[(*k, column)] * factor;
                    }
                }
                _ => {}
            }
        }
        slopes
    }

    /// Converts derivatives by the model's inputs into derivatives by the study's parameters, in the study's unit.
    fn by_parameters(&self, jacobian: &Matrix, point: &[f64]) -> Matrix {
        let mut product = multiply(jacobian, &self.slopes(point));
        product.as_mut_slice().iter_mut().for_each(|value| *value *= self.factor);
        product
    }

    /// The response in the study's unit, checked for finite values and for their number.
    pub fn checked(&self, response: Result<Response, EvalError>) -> Result<Response, EvalError> {
        self.checked_on(&self.asked, response)
    }

    fn checked_on(
        &self,
        layout: &Layout,
        response: Result<Response, EvalError>,
    ) -> Result<Response, EvalError> {
        let mut response = response?;
        let (found, asked) = (response.values.len(), layout.len());
        if found != asked {
            let text = format!("the response has {found} values, expected {asked}");
            return Err(EvalError::Fatal(text));
        }
        for (i, value) in response.values.iter_mut().enumerate() {
            if !value.is_finite() {
                let place = layout.describe(i);
                return Err(EvalError::Rejected(format!("the response is {value} at {place}")));
            }
            *value *= self.factor;
        }
        Ok(response)
    }
}

//! The study's model as a function of the study's parameters, in the study's units.

use std::path::Path;

use crate::data::{Axis, Coordinates, Layout, Scenario};
use crate::plugin::model::{Call, EvalError, Model, Response};
use crate::plugin::registry::Section;
use crate::run::Stop;
use crate::study::Study;
use crate::study::file::ModelKeys;

/// A model with its fixed inputs, fed with the study's parameters.
pub struct Simulator<'a> {
    /// The folder of the study file.
    study: &'a Path,
    /// The model.
    pub model: &'a dyn Model,
    /// The response that is asked of the model: the study's layout in the model's units.
    pub asked: Layout,
    /// The conditions of all runs.
    pub scenario: Scenario,
    /// The name of each input of the model.
    pub names: Vec<String>,
    /// One entry an input of the model.
    sources: Vec<Source>,
    /// Turns the model's response into the study's unit.
    factor: f64,
}

/// Where an input's value comes from.
enum Source {
    Fixed(f64),
    /// The index of a parameter of the study and the factor from its unit to the input's.
    Parameter(usize, f64),
}

impl<'a> Simulator<'a> {
    /// The simulator of a study, if it has a model.
    pub fn of(study: &'a Study) -> Result<Option<Self>, Stop> {
        study.model.as_ref().map(|section| Self::with_model(study, section)).transpose()
    }

    /// The simulator of a study with another model in place of its own.
    pub fn with_model(
        study: &'a Study,
        section: &'a Section<dyn Model, ModelKeys>,
    ) -> Result<Self, Stop> {
        let model = &*section.built.plugin;
        let signature = model.signature(&study.context());
        let mut sources = Vec::new();
        for input in &signature.inputs {
            let parameter = study.parameters.iter().position(|p| p.name == input.name);
            let fixed = section.common.fixed.get(&input.name).copied().or(input.default);
            sources.push(match (parameter, fixed) {
                (Some(i), _) => {
                    let unit = &study.parameters[i].unit;
                    let factor = unit.factor_to(&input.unit).ok_or_else(|| {
                        Stop::new(format!("`{}` has no unit of the model's", input.name))
                    })?;
                    Source::Parameter(i, factor)
                }
                (None, Some(value)) => Source::Fixed(value),
                (None, None) => {
                    return Err(Stop::new(format!("nothing sets the input `{}`", input.name)));
                }
            });
        }
        let (asked, factor) = asked(&study.layout, &signature.layout)?;
        Ok(Self {
            study: &study.directory,
            model,
            asked,
            scenario: Scenario::default(),
            names: signature.inputs.into_iter().map(|input| input.name).collect(),
            sources,
            factor,
        })
    }

    /// The model's inputs for one point of the study's parameters.
    pub fn inputs(&self, point: &[f64]) -> Vec<f64> {
        let value = |source: &Source| match source {
            Source::Fixed(value) => *value,
            Source::Parameter(i, factor) => point[*i] * factor,
        };
        self.sources.iter().map(value).collect()
    }

    /// The response at one point, in the study's unit.
    pub fn respond(&self, point: &[f64]) -> Result<Response, EvalError> {
        let inputs = self.inputs(point);
        let call = Call {
            inputs: &inputs,
            names: &self.names,
            layout: &self.asked,
            scenario: &self.scenario,
            study: self.study,
            directory: None,
        };
        let mut response = self.model.predict(&call)?;
        for (i, value) in response.values.iter_mut().enumerate() {
            if !value.is_finite() {
                let place = self.asked.describe(i);
                return Err(EvalError::Rejected(format!("the response is {value} at {place}")));
            }
            *value *= self.factor;
        }
        Ok(response)
    }
}

/// The study's layout in the model's units, and the factor from the model's unit to the study's.
fn asked(ours: &Layout, theirs: &Layout) -> Result<(Layout, f64), Stop> {
    let mismatch = |what: &str| Stop::new(format!("{what} does not convert to the model's unit"));
    let factor =
        theirs.unit.factor_to(&ours.unit).ok_or_else(|| mismatch("the response's unit"))?;
    let axis = |(a, b): (&Axis, &Axis)| match (&a.coordinates, &b.coordinates) {
        (Coordinates::Grid { values, unit }, Coordinates::Grid { unit: known, .. }) => {
            let scale = unit.factor_to(known).ok_or_else(|| mismatch(&a.name))?;
            let values = values.iter().map(|v| v * scale).collect();
            Ok(Axis::grid(&a.name, values, known.clone()))
        }
        _ => Ok(a.clone()),
    };
    let axes = ours.axes.iter().zip(&theirs.axes).map(axis).collect::<Result<_, Stop>>()?;
    Ok((Layout { name: ours.name.clone(), unit: theirs.unit.clone(), axes }, factor))
}

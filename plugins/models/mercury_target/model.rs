//! The solver as a plugin: inputs, response layout, history files.

use std::path::Path;

use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::{Component, Context, Fact};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::inputs::{Filling, deck, inputs, values};
use super::settings::{Gauges, Geometry, Numerics, Pulse, Sampling, Settings, Wall};
use super::{Outcome, SimulationError};
use crate::readers::sierra::write::{History, Origin, write_history};

/// Strain of a mercury-filled steel vessel after a proton pulse: an open stand-in for the Sierra model of the
/// Spallation Neutron Source's target, whose input decks and data are not public.
///
/// Axisymmetric explicit dynamics. The mercury is inviscid, with pressure = bulk modulus x volumetric strain, limited
/// to minus the tensile cutoff while tension grows. The wall is a Mindlin shell. Inputs: `density` (kg/m³),
/// `sound_speed` (m/s), `tensile_cutoff` (Pa). Response: `strain` (dimensionless) over `sensor` (the gauges) and
/// `time` (s).
///
/// A study may also set the inputs `damping` (1/s: vibrations decay as exp(-damping t / 2)), `pulse_energy` and
/// `wall_thickness` (relative to the options), `beam_width` (m) and `rear_reflection` (the share of the pressure that the
/// rear end reflects); otherwise the options, zero damping and an absorbing end apply. The inputs of `mercury_target_equilibrium_gas` and `mercury_target_bubbles` are accepted without effect, so that a
/// study can change the model by its name alone.
///
/// The output times must be whole multiples of the smallest step between them. Each run is written as an Exodus II
/// history file with the signals `strain_NAME`, as Sierra writes them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MercuryTarget {
    /// Shape of the vessel.
    pub geometry: Geometry,
    /// Steel wall.
    pub wall: Wall,
    /// Energy deposited by the proton pulse.
    pub pulse: Pulse,
    /// Mesh, time step and numerical damping.
    pub numerics: Numerics,
    /// Strain gauges on the outer face of the wall, in the order of the response's `sensor` axis; names must differ.
    /// Default: the ten gauges of the single-pulse tests at WNR in 1999.
    pub gauges: Gauges,
}

/// The dimensionless unit, used for strain.
fn dimensionless() -> Unit {
    Unit::dimensionless()
}

pub(super) fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap_or_else(|_| dimensionless())
}

impl MercuryTarget {
    fn settings(&self, sampling: Sampling) -> Settings {
        Settings {
            geometry: self.geometry.clone(),
            wall: self.wall.clone(),
            pulse: self.pulse.clone(),
            numerics: self.numerics.clone(),
            gauges: self.gauges.clone(),
            sampling,
            damping: 0.0,
            rear_reflection: 0.0,
        }
    }

    fn layout(&self) -> Layout {
        let Sampling { interval, count } = Sampling::default();
        let grid = (1..=count).map(|i| i as f64 * interval).collect();
        Layout {
            name: "strain".to_owned(),
            unit: dimensionless(),
            axes: vec![
                Axis::labels("sensor", self.gauges.0.iter().map(|gauge| gauge.name.clone())),
                Axis::grid("time", grid, unit("s")),
            ],
        }
    }

    /// The signature with the inputs of a model of this vessel.
    pub(crate) fn signed(&self, filling: Filling, context: &Context<'_>) -> Signature {
        let inputs = inputs(self, filling, context);
        Signature { inputs, layout: self.layout(), resamples: true }
    }

    /// Runs a model of this vessel.
    pub(crate) fn respond(&self, filling: Filling, call: &Call<'_>) -> Result<Response, EvalError> {
        let times = times(call.layout).map_err(EvalError::Fatal)?;
        let (sampling, steps) = sampling(times).map_err(EvalError::Fatal)?;
        let (given, idle) = values(self, filling, call)?;
        let outcome =
            given.simulate(filling, self.settings(sampling)).map_err(|error| match error {
                SimulationError::Settings(_) => EvalError::Fatal(error.to_string()),
                other => EvalError::Rejected(other.to_string()),
            })?;
        let mut values = Vec::with_capacity(call.layout.len());
        for gauge in self.asked(call.layout)? {
            values.extend(steps.iter().map(|&step| outcome.strain[gauge][step - 1]));
        }
        let mut facts = facts(&outcome);
        if !idle.is_empty() {
            facts.push(Fact::new("inputs without effect", idle.join(", ")));
        }
        Ok(Response { values, valid: outcome.valid, facts })
    }

    /// Writes a run of the model of this name as an Exodus II history file.
    pub(crate) fn write_run(
        &self,
        model: &str,
        run: &str,
        call: &Call<'_>,
        response: &Response,
        directory: &Path,
    ) -> Result<Option<String>, EvalError> {
        let times = times(call.layout).map_err(EvalError::Fatal)?;
        let gauges = self.asked(call.layout)?;
        let names = gauges.iter().map(|&g| format!("strain_{}", self.gauges.0[g].name)).collect();
        let values = response.values.chunks(times.len()).map(<[f64]>::to_vec).collect();
        let history = History { times: times.to_vec(), names, values };
        let facts = response.facts.iter().map(|fact| format!("{} = {}", fact.name, fact.value));
        let origin = Origin {
            title: format!("{run}: {model}, a stand-in for the SNS target"),
            // A fixed date, so that equal runs give files that are equal to the byte.
            qa: ["lacuna", env!("CARGO_PKG_VERSION"), "1970/01/01", "00:00:00"].map(str::to_owned),
            info: deck(call).chain(facts).chain([format!("valid = {}", response.valid)]).collect(),
        };
        let file = format!("{run}.h");
        write_history(&directory.join(&file), &origin, &history)
            .map_err(|error| EvalError::Fatal(error.to_string()))?;
        Ok(Some(file))
    }

    /// The indices of the gauges in the layout's first axis.
    fn asked(&self, layout: &Layout) -> Result<Vec<usize>, EvalError> {
        let sensors = layout.axes.first().map(|axis| &axis.coordinates);
        let Some(Coordinates::Labels(labels)) = sensors else {
            return Err(EvalError::Fatal("the first axis must be the gauges".to_owned()));
        };
        let find = |label: &String| {
            let found = self.gauges.0.iter().position(|gauge| &gauge.name == label);
            found.ok_or_else(|| EvalError::Fatal(format!("the vessel has no gauge `{label}`")))
        };
        labels.iter().map(find).collect()
    }
}

fn facts(outcome: &Outcome) -> Vec<Fact> {
    let cavitated = outcome.cavitated_fraction.iter().copied().fold(0.0, f64::max);
    let strain = outcome.largest_volumetric_strain;
    vec![
        Fact::new("saturation time", format!("{:.4e} s", outcome.saturation_time)),
        Fact::new("largest cavitated share", format!("{cavitated:.3}")),
        Fact::new("largest volumetric strain", format!("{strain:.3e}")),
        Fact::new("time steps", outcome.steps),
    ]
}

fn times(layout: &Layout) -> Result<&[f64], String> {
    match layout.axes.get(1).map(|axis| &axis.coordinates) {
        Some(Coordinates::Grid { values, .. }) => Ok(values),
        _ => Err("the second axis must be the time".to_owned()),
    }
}

/// The sampling whose outputs contain all `times`, s, and the number of the output at each of them. Fails if the
/// times are no whole multiples of their smallest step.
fn sampling(times: &[f64]) -> Result<(Sampling, Vec<usize>), String> {
    let gaps = times.windows(2).map(|pair| pair[1] - pair[0]);
    let interval = gaps.fold(times.first().copied().unwrap_or(0.0), f64::min);
    if interval.is_nan() || interval <= 0.0 {
        return Err("the first output time must be after the pulse at time 0".to_owned());
    }
    let mut steps = Vec::with_capacity(times.len());
    for &time in times {
        let step = (time / interval).round();
        if (time / interval - step).abs() > 1e-6 * step {
            return Err(format!(
                "the output time {time} s is not a whole multiple of the smallest step {interval} s"
            ));
        }
        steps.push(step as usize);
    }
    let count = steps.last().copied().unwrap_or(1);
    Ok((Sampling { interval, count }, steps))
}

impl Component for MercuryTarget {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let ours = self.layout();
        let convertible = context.layout.axes.len() == 2;
        if convertible && let Ok(given) = times(context.layout) {
            // The engine converts the axis to seconds; multiples do not depend on the unit.
            if let Err(reason) = sampling(given) {
                complaints.at("").say(format!("`{}`: {reason}", ours.axes[1].name));
            }
        }
        if let Err(error) = self.settings(Sampling::default()).validate() {
            complaints.at("").say(error.to_string());
        }
        let names = || self.gauges.0.iter().map(|gauge| &gauge.name);
        if let Some((_, twice)) =
            names().enumerate().find(|(i, n)| names().take(*i).any(|m| m == *n))
        {
            complaints.at("gauges").say(format!("two gauges are called `{twice}`"));
        }
    }
}

/// Implements a model for a type that holds the vessel. Models differ in filling and name only.
macro_rules! filled {
    ($model:ident, $name:literal, $filling:ident $(, $field:tt)?) => {
        impl lacuna::plugin::Model for $model {
            fn signature(&self, context: &Context<'_>) -> Signature {
                self$(.$field)?.signed(Filling::$filling, context)
            }

            fn unused(&self, context: &Context<'_>) -> Vec<String> {
                $crate::models::mercury_target::unused(Filling::$filling, context)
            }

            fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
                self$(.$field)?.respond(Filling::$filling, call)
            }

            fn write(
                &self,
                run: &str,
                call: &Call<'_>,
                response: &Response,
                directory: &Path,
            ) -> Result<Option<String>, EvalError> {
                self$(.$field)?.write_run($name, run, call, response, directory)
            }
        }

        lacuna::register!(lacuna::plugin::Model, $name, $model);
    };
}

pub(crate) use filled;

filled!(MercuryTarget, "mercury_target", Mercury);

#[cfg(test)]
mod tests {
    use lacuna::plugin::Model;

    use super::*;

    #[test]
    fn outputs_at_multiples_of_the_smallest_step_are_found() {
        let (sampling, steps) = sampling(&[2e-5, 3e-5, 7e-5]).unwrap();
        assert!((sampling.interval - 1e-5).abs() < 1e-18);
        assert_eq!((sampling.count, steps), (7, vec![2, 3, 7]));
        assert!(super::sampling(&[0.0, 1e-5]).is_err());
        assert!(super::sampling(&[1e-5, 2.5e-5]).is_err());
    }

    #[test]
    fn a_subset_of_gauges_gives_those_rows_of_the_whole() {
        let model = MercuryTarget::default();
        let whole = model.layout();
        let times: Vec<f64> = (1..=10).map(|i| f64::from(i) * 1e-5).collect();
        let part = |labels: &[&str]| Layout {
            axes: vec![
                Axis::labels("sensor", labels.iter().copied()),
                Axis::grid("time", times.clone(), unit("s")),
            ],
            ..whole.clone()
        };
        let scenario = lacuna::data::Scenario::default();
        let names = ["density", "sound_speed", "tensile_cutoff"].map(str::to_owned);
        let respond = |layout: &Layout| {
            let call = Call::new(&[13_500.0, 1456.0, 1.5e5], &names, layout, &scenario);
            model.predict(&call).unwrap().values
        };
        let (both, one) = (respond(&part(&["T", "B"])), respond(&part(&["B"])));
        assert_eq!(both[10..], one[..]);
    }
}

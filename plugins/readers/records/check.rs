//! Checks of the options of records against the study.

use lacuna::data::{Coordinates, Layout};
use lacuna::plugin::Context;
use lacuna::text::problem::Complaints;

use super::place::Resample;
use super::store::REPLICATE;
use super::{REPLICATES, Records, in_path, replicate_files};
use crate::readers::{listed, scenario};

impl Records {
    /// Checks the options. `states_times`: the files may state the times of samples themselves.
    pub fn check(
        &self,
        states_times: bool,
        context: &Context<'_>,
        complaints: &mut Complaints<'_>,
    ) {
        let layout = context.layout;
        let is_grid = |c: &Coordinates| matches!(c, Coordinates::Grid { .. });
        let grids = layout.axes.iter().filter(|axis| is_grid(&axis.coordinates)).count();
        if grids > 1 {
            complaints.at("").say(format!(
                "this reader reads records over one numeric axis, and `{}` has {grids}",
                layout.name
            ));
        }
        self.check_times(grids > 0 && !states_times, complaints);
        self.check_units(layout, complaints);
        self.check_names(layout, complaints);
        if self.trigger.is_some() && self.resample == Resample::Exact {
            complaints
                .at("trigger")
                .say("`trigger` needs `resample`: a crossing lies between two samples")
                .expected("`resample = \"linear\"` or `\"filtered\"`");
        }
        for (key, pattern) in [
            ("time", self.time.as_deref()),
            ("trigger.channel", self.trigger.as_ref().map(|t| t.channel.as_str())),
        ] {
            let own = self.dataset.as_deref().is_some_and(|text| text.contains(REPLICATE));
            if pattern.is_some_and(|text| text.contains(REPLICATE)) && !own {
                complaints
                    .at(key)
                    .say(format!("`{key}` has `{REPLICATE}`, and `dataset` does not have it"));
            }
        }
        let in_path = self.path.as_deref().is_some_and(in_path);
        let in_dataset = self.dataset.as_deref().is_some_and(|text| text.contains(REPLICATE));
        if in_path && in_dataset {
            complaints.at("dataset").say(format!(
                "`path` and `dataset` both have `{REPLICATE}`: replicates are files or datasets"
            ));
        }
    }

    fn check_times(&self, needed: bool, complaints: &mut Complaints<'_>) {
        if self.time.is_some() && self.step.is_some() {
            complaints.at("step").say("`time` and `step` exclude each other");
        } else if needed && self.time.is_none() && self.step.is_none() {
            complaints.at("").say("the options do not state the times of the samples").help(
                "name their dataset with `time`, or give `step`, the interval between samples",
            );
        }
        if self.first.is_some() && self.step.is_none() {
            complaints.at("first").say("`first` needs `step`, the interval between samples");
        }
        for (key, number, least) in [("step", self.step, 0.0), ("first", self.first, f64::MIN)] {
            if let Some(x) = number.filter(|x| !(x.is_finite() && *x > least)) {
                let expected = if key == "step" { "a number above 0" } else { "a finite number" };
                complaints.at(key).say(format!("`{key}` is {x}")).expected(expected);
            }
        }
        if let Some(trigger) = &self.trigger {
            for (key, x) in [("trigger.level", trigger.level), ("trigger.at", trigger.at)] {
                if !x.is_finite() {
                    complaints.at(key).say(format!("`{key}` is {x}")).expected("a finite number");
                }
            }
        }
    }

    fn check_units(&self, layout: &Layout, complaints: &mut Complaints<'_>) {
        let time = layout.abscissa().map(|(_, _, unit)| unit);
        for (key, from, to) in
            [("unit", &self.unit, Some(&layout.unit)), ("time_unit", &self.time_unit, time)]
        {
            if let (Some(from), Some(to)) = (from, to)
                && from.convert(1.0, to).is_none()
            {
                complaints
                    .at(key)
                    .say(format!("`{key}` does not convert to the response's"))
                    .expected(format!("a unit like `{to}`"))
                    .found(format!("`{from}`"));
            }
        }
    }

    fn check_names(&self, layout: &Layout, complaints: &mut Complaints<'_>) {
        let label_axes: Vec<&str> = layout
            .axes
            .iter()
            .filter(|axis| matches!(axis.coordinates, Coordinates::Labels(_)))
            .map(|axis| axis.name.as_str())
            .collect();
        for name in self.labels.keys().filter(|name| !label_axes.contains(&name.as_str())) {
            complaints
                .at(&format!("labels.{name}"))
                .say(format!("the response has no axis `{name}` with labels"))
                .expected(listed(&label_axes));
        }
        let Some(axes) = &self.axes else { return };
        let pattern = self.dataset.as_deref().unwrap_or(&layout.name);
        let mut expected: Vec<&str> = layout.axes.iter().map(|axis| axis.name.as_str()).collect();
        expected.retain(|axis| !pattern.contains(&format!("{{{axis}}}")));
        let mut found: Vec<&str> =
            axes.iter().map(String::as_str).filter(|axis| *axis != REPLICATES).collect();
        let replicates = axes.len() - found.len();
        found.sort_unstable();
        let mut sorted = expected.clone();
        sorted.sort_unstable();
        if found != sorted || replicates > 1 {
            complaints
                .at("axes")
                .say("`axes` does not have each axis of the response that `dataset` does not name")
                .expected(format!(
                    "{} in the order of the file, and possibly `{REPLICATES}`",
                    listed(&expected)
                ))
                .found(listed(axes));
        } else if replicates == 1 && pattern.contains(REPLICATE) {
            complaints.at("axes").say(format!(
                "`dataset` has `{REPLICATE}`, so that no dimension is `{REPLICATES}`"
            ));
        }
    }

    /// Reports files that do not exist.
    pub fn check_files(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let path = self.path.as_deref();
        let single = path.filter(|path| !in_path(path));
        scenario::check_files(
            [("path", single), ("runs", self.runs.as_deref())],
            context,
            complaints,
        );
        if let Some(path) = path.filter(|path| in_path(path)) {
            for scenario in context.scenarios {
                let scenario = scenario.label();
                let (path, files) = replicate_files(context.directory, path, scenario);
                if files.is_empty() {
                    complaints
                        .at("path")
                        .say(format!("there is no file `{}`", path.display()))
                        .help(format!("`{REPLICATE}` stands for the name of a replicate"));
                }
            }
        }
    }
}

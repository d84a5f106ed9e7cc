//! Parameters of which bounds are known and no distribution, `prior = { interval = [1, 2] }`, in a study without data.

use lacuna::text::{Complaints, Node};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plain::Study;

/// Search for the bounds of quantities over the intervals of parameters: the smallest and the largest mean, standard
/// deviation and quantiles that any values inside the intervals give.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IntervalsSection {
    /// Largest number of points of the intervals' box at which the distribution of the quantities is computed. The search
    /// ends earlier if its two independent halves agree. Default: 128 points, and `80 (2 k + 1)` for each quantity if `k`
    /// parameters have intervals, at most 5000; without a surrogate, if other parameters have distributions, `80 (2 k + 1)`
    /// for all quantities together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<usize>,
    /// Number of draws of the distributions at each of these points. The bounds that are printed are computed anew with
    /// all `draws` of `[forward]` at the points that the search found. Default: 1000 with a surrogate, 200 without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draws: Option<usize>,
}

/// Size of the search over the intervals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchSize {
    /// Largest number of points of the box.
    pub points: usize,
    /// Number of draws at each point.
    pub draws: usize,
}

/// Largest number of parameters with intervals: the gradient of each figure is taken by differences.
const MOST: usize = 100;

/// Smallest number of draws that shows quantiles.
const FEWEST_DRAWS: usize = 100;

/// Largest default number of points.
const MOST_POINTS: usize = 5000;

impl Study {
    /// Places among the parameters of those of which bounds are known only.
    pub fn intervals(&self) -> Vec<usize> {
        (0..self.unknowns.len()).filter(|&j| self.unknowns[j].interval).collect()
    }

    /// Returns true if any input of the propagation has a distribution.
    pub fn has_distributions(&self) -> bool {
        self.unknowns.iter().any(|unknown| !unknown.interval) || self.has_effects()
    }

    /// Size of the search over the intervals.
    pub fn interval_search(&self) -> SearchSize {
        let section = self.forward.as_ref().and_then(|forward| forward.intervals.as_ref());
        let emulated = self.surrogate.is_some();
        let (k, asked) = (self.intervals().len(), self.quantities.len());
        // Without a surrogate each draw is a run of the model.
        let is_cheap = emulated || !self.has_distributions();
        let shares = if is_cheap { asked } else { asked.min(1) };
        let thorough = (128 + 80 * shares * (2 * k + 1)).min(MOST_POINTS);
        SearchSize {
            points: section.and_then(|own| own.points).unwrap_or(thorough),
            draws: section.and_then(|own| own.draws).unwrap_or(if emulated { 1000 } else { 200 }),
        }
    }
}

/// Smallest number of points with which a search of `k` intervals can begin.
fn fewest_points(k: usize) -> usize {
    16 * (k + 1)
}

/// Reports intervals in a study that needs distributions or asks for nothing, and a search that cannot work.
pub(super) fn check(study: &Study, root: &Node, complaints: &mut Complaints<'_>) {
    let places = study.intervals();
    let size = study.interval_search();
    let section = study.forward.as_ref().and_then(|forward| forward.intervals.as_ref());
    if places.is_empty() {
        if section.is_some() {
            complaints
                .at("forward.intervals")
                .say("no parameter is known as an interval only")
                .help("`prior = { interval = [1, 2] }` of a `[[parameter]]` states one");
        }
        return;
    }
    if let Some(needs) = needs_priors(root) {
        let mut names: Vec<&str> = places.iter().map(|&j| &*study.unknowns[j].name).collect();
        names.dedup();
        for name in names {
            complaints
                .at(&format!("parameter.{name}.prior"))
                .say(format!(
                    "{needs} needs a distribution of `{name}`, which an interval does not state"
                ))
                .expected(format!("a distribution such as `uniform`, or a study without {needs}"));
        }
        return;
    }
    let first = format!("parameter.{}.prior", study.unknowns[places[0]].name);
    if study.quantities.is_empty() {
        complaints
            .at(&first)
            .say("the study has no quantity to be bounded over the interval")
            .expected("at least one `[[quantity]]`");
    }
    if places.len() > MOST {
        complaints
            .at(&first)
            .say("too many parameters with intervals for a search")
            .expected(format!("at most {MOST}"))
            .found(places.len());
    }
    if size.points < fewest_points(places.len()) {
        complaints
            .at("forward.intervals.points")
            .say("too few points for a search over the intervals")
            .expected(format!("at least {}", fewest_points(places.len())))
            .found(size.points);
    }
    if size.draws < FEWEST_DRAWS {
        complaints
            .at("forward.intervals.draws")
            .say("too few draws for bounds of quantiles")
            .expected(format!("at least {FEWEST_DRAWS}"))
            .found(size.draws);
    }
}

/// First section of a study that is computed from distributions of all parameters.
fn needs_priors(root: &Node) -> Option<String> {
    let tables = ["target", "measurements", "discrepancy", "sampler"];
    let table = tables.iter().find(|name| root.get(name).is_some());
    let list = root.get("reliability").map(|_| String::from("`[[reliability]]`"));
    table.map(|name| format!("`[{name}]`")).or(list)
}

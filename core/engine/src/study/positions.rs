//! Positions of labels along the axes of the response.

use std::collections::{BTreeMap, HashMap};

use lacuna::data::Unit;
use lacuna::text::labels::{LabelSection, place};
use lacuna::text::response::{Axes, AxisSection, ResponseSection};
use lacuna::text::{Complaints, Node, Problems};
use serde::Serialize;

use super::scenario::ScenarioSection;

/// The positions of labels along an axis, such as the places of sensors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Positions {
    /// The axis.
    pub axis: String,
    /// The coordinate of each label, in `unit`.
    pub at: BTreeMap<String, f64>,
    /// The unit of the coordinates.
    pub unit: Unit,
}

/// The positions of all axes, those of scenarios in the unit of `[response]`; `None` after reporting an error.
pub(super) fn positions(
    response: &ResponseSection,
    scenarios: &[ScenarioSection],
    root: &Node,
    problems: &mut Problems,
) -> Option<Vec<Positions>> {
    let (mut all, before) = (Vec::new(), problems.len());
    let mut take = |path: &str, axes: &Axes, node: &Node, problems: &mut Problems| {
        problems.within(path, |problems| {
            for (name, axis) in &axes.0 {
                let AxisSection::Placed(section) = axis else { continue };
                if let Err((key, reason)) = merged(&mut all, name.as_str(), section) {
                    let key = format!("axes.{}.{key}", name.as_str());
                    let message =
                        format!("the positions of the axis `{}`: {reason}", name.as_str());
                    Complaints::new(node, problems).at(&key).say(message);
                }
            }
        });
    };
    take("response", &response.axes, root.get("response")?, problems);
    let sections = root.get("scenario").map(Node::elements).unwrap_or_default();
    for (scenario, node) in scenarios.iter().zip(sections) {
        take(&format!("scenario.{}", scenario.name), &scenario.axes, node, problems);
    }
    (problems.len() == before).then_some(all)
}

/// Adds the positions of a section; fails with the key and the reason.
fn merged(
    all: &mut Vec<Positions>,
    axis: &str,
    section: &LabelSection,
) -> Result<(), (&'static str, String)> {
    let placed = section.placed().map_err(|reason| ("positions", reason))?;
    if placed.is_empty() {
        return Ok(());
    }
    let k = all.iter().position(|known| known.axis == axis).unwrap_or_else(|| {
        let unit = section.unit.clone();
        all.push(Positions { axis: axis.to_owned(), at: BTreeMap::new(), unit });
        all.len() - 1
    });
    let known = &mut all[k];
    let mut there: HashMap<u64, String> =
        known.at.iter().map(|(label, x)| (place(*x), label.clone())).collect();
    for (label, x) in placed {
        let Some(x) = section.unit.convert(x, &known.unit) else {
            let reason =
                format!("expected a unit such as `{}`, found `{}`", known.unit, section.unit);
            return Err(("unit", reason));
        };
        if let Some(other) = there.get(&place(x)).filter(|other| *other != label) {
            let reason =
                format!("expected different positions, found {x} for both `{other}` and `{label}`");
            return Err(("positions", reason));
        }
        there.insert(place(x), label.to_owned());
        let before = known.at.insert(label.to_owned(), x);
        if let Some(before) = before.filter(|before| *before != x) {
            let reason = format!("expected one position of `{label}`, found {before} and {x}");
            return Err(("positions", reason));
        }
    }
    Ok(())
}

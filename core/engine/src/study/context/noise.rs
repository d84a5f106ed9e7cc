//! `noise` of `[measurements]` against the response.

use lacuna::data::Unit;
use lacuna::text::quantity::Quantity;
use lacuna::text::{Complaints, Node, Problems};

use crate::study::noise::{NoiseSection, axis_unit};
use crate::study::resolve::Study;

/// Reports noise with values, units or places that the response cannot have.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let Some(noise) = study.measurements.as_ref().and_then(|s| s.common.noise.as_ref()) else {
        return;
    };
    let Some(node) = root.get("measurements") else { return };
    let is_list = node.get("noise").is_some_and(|node| !node.elements().is_empty());
    problems.within("measurements", |problems| {
        let mut complaints = Complaints::new(node, problems);
        for (k, section) in noise.0.iter().enumerate() {
            let path = if is_list { format!("noise.{k}") } else { "noise".to_owned() };
            one(study, section, &path, &mut complaints);
        }
    });
}

fn one(study: &Study, section: &NoiseSection, path: &str, complaints: &mut Complaints<'_>) {
    let NoiseSection { on, sd, resolution, memory } = section;
    super::effects::places(study, &format!("{path}.on"), on, complaints);
    if sd.is_none() && resolution.is_none() && memory.is_none() {
        complaints
            .at(path)
            .say("noise of which nothing is stated")
            .expected("`sd`, `resolution` or `memory`");
    }
    let unit = &study.layouts.blocks[0].unit;
    for (key, quantity) in [("sd", sd), ("resolution", resolution)] {
        let Some(quantity) = quantity else { continue };
        let path = format!("{path}.{key}");
        if has_unit(quantity, unit, "the response", &path, complaints) && quantity.value <= 0.0 {
            let value = quantity.value;
            let said = format!("`{key}` of noise is not positive");
            complaints.at(&path).say(said).expected("a number above 0").found(value);
        }
    }
    let Some(memory) = memory else { return };
    let path = format!("{path}.memory");
    let Some(axis) = study.layouts.blocks.iter().find_map(axis_unit) else {
        complaints
            .at(&path)
            .say("the response has no axis of numbers along which noise could have a memory")
            .help("take `memory` out: values of different labels count as independent");
        return;
    };
    if has_unit(memory, axis, "the last axis", &path, complaints) && memory.value < 0.0 {
        complaints
            .at(&path)
            .say("`memory` of noise is negative")
            .expected("0 for independent values, or more")
            .found(memory.value);
    }
}

/// Reports a unit of another dimension and a value that is not finite; returns true if there is nothing to report.
fn has_unit(
    quantity: &Quantity,
    unit: &Unit,
    of: &str,
    path: &str,
    complaints: &mut Complaints<'_>,
) -> bool {
    match quantity.in_unit(unit) {
        None => {
            let found = quantity.unit.as_ref().map_or(String::new(), |own| format!("`{own}`"));
            complaints
                .at(path)
                .say(format!("the unit of {of} has another dimension"))
                .expected(format!("a unit that converts to `{unit}`"))
                .found(found);
        }
        Some(value) if !value.is_finite() => {
            complaints.at(path).say("not a finite number").expected("a number").found(value);
        }
        Some(_) => return true,
    }
    false
}

//! The response of a study against that of its model.

use lacuna::data::{Coordinates, Layout};
use lacuna::plugin::model::Signature;
use lacuna::text::Complaints;

/// Reports what does not fit.
pub(super) fn check(ours: &Layout, signature: &Signature, complaints: &mut Complaints<'_>) {
    let theirs = &signature.layout;
    if ours.unit.factor_to(&theirs.unit).is_none() {
        complaints
            .at("response.unit")
            .say(format!("the model's `{}` has another dimension", theirs.name))
            .expected(format!("a unit that converts to `{}`", theirs.unit))
            .found(format!("`{}`", ours.unit));
    }
    let names = |axes: &[lacuna::data::Axis]| {
        axes.iter().map(|a| format!("`{}`", a.name)).collect::<Vec<_>>().join(", ")
    };
    let same_names = ours.axes.len() == theirs.axes.len()
        && ours.axes.iter().zip(&theirs.axes).all(|(a, b)| a.name == b.name);
    if !same_names {
        complaints
            .at("response.axes")
            .say("the model's response has other axes")
            .expected(if theirs.axes.is_empty() {
                "no axes".to_owned()
            } else {
                names(&theirs.axes)
            })
            .found(if ours.axes.is_empty() { "none".to_owned() } else { names(&ours.axes) });
        return;
    }
    for (a, b) in ours.axes.iter().zip(&theirs.axes) {
        let path = format!("response.axes.{}", a.name);
        match (&a.coordinates, &b.coordinates) {
            (Coordinates::Labels(labels), Coordinates::Labels(known)) => {
                for label in labels.iter().filter(|label| !known.contains(label)) {
                    let listed = known.iter().map(|l| format!("`{l}`")).collect::<Vec<_>>();
                    complaints
                        .at(&path)
                        .say(format!("the model has no {} `{label}`", a.name))
                        .expected(format!("some of {}", listed.join(", ")));
                }
            }
            (Coordinates::Grid { unit, .. }, Coordinates::Grid { unit: known, .. }) => {
                if unit.factor_to(known).is_none() {
                    complaints
                        .at(&format!("{path}.unit"))
                        .say(format!("the axis `{}` has the wrong unit", a.name))
                        .expected(format!("a unit that converts to `{known}`"))
                        .found(format!("`{unit}`"));
                }
            }
            (Coordinates::Labels(_), Coordinates::Grid { .. }) => {
                complaints
                    .at(&path)
                    .say(format!("the axis `{}` is a grid of numbers", a.name))
                    .expected("a table such as `{ first = 1e-5, last = 1e-3, count = 100, unit = \"s\" }`")
                    .found("labels");
            }
            (Coordinates::Grid { .. }, Coordinates::Labels(_)) => {
                complaints
                    .at(&path)
                    .say(format!("the axis `{}` is a list of labels", a.name))
                    .expected("a list such as `[\"B\", \"C\"]`")
                    .found("a grid of numbers");
            }
        }
    }
}

//! Scenarios of a study that writes none, from the groups in its measurements.

use std::path::Path;

use lacuna::plugin::Reader;
use lacuna::plugin::reader::Groups;
use lacuna::plugin::registry::{Section, section};
use lacuna::text::node::{Key, Node};
use lacuna::text::{Complaints, Problems, Value};

use crate::study::file::MeasurementKeys;

/// Adds a `[[scenario]]` for each group that the reader of the measurements names, unless the study has some.
pub(in crate::study) fn groups_as_scenarios(
    root: &mut Node,
    directory: &Path,
    problems: &mut Problems,
) {
    let Some(node) = root.get("measurements").filter(|_| root.get("scenario").is_none()) else {
        return;
    };
    // What is wrong in the section is reported where it is read.
    let read: Option<Section<dyn Reader, MeasurementKeys>> =
        section(node, None, &mut Problems::new());
    let Some(read) = read else { return };
    let found = match read.built.plugin.groups(directory) {
        Ok(Some(found)) => found,
        Ok(None) => return,
        Err(error) => {
            Complaints::new(root, problems).at("measurements.groups").say(error.to_string());
            return;
        }
    };
    let place = node.nearest_place("groups");
    let scenarios = Node { value: Value::Array(written(&found, &place)), place: place.clone() };
    root.set(Key { name: "scenario".to_owned(), place }, scenarios);
}

/// A `[[scenario]]` with the name and the label of each group.
fn written(groups: &Groups, place: &lacuna::text::Place) -> Vec<Node> {
    let key = |name: &str| Key { name: name.to_owned(), place: place.clone() };
    let one = |name: &String| {
        let mut labels = Node::table(place.clone());
        labels.set(key(&groups.label), Node::string(name, place.clone()));
        let mut scenario = Node::table(place.clone());
        scenario.set(key("name"), Node::string(name, place.clone()));
        scenario.set(key("labels"), labels);
        scenario
    };
    groups.names.iter().map(one).collect()
}

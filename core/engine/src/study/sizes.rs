//! Memory needed by the sizes in a study: an impossible size is refused before anything is allocated, and so is a study whose
//! parts do not fit together.

use std::fmt;

use lacuna::plugin::Size;
use lacuna::plugin::sampler::Plan;
use lacuna::text::memory::{MOST, NUMBER, amount, of_machine};
use lacuna::text::{Complaints, Node, Problems};

use super::plain::Study;

/// Memory of a measured value, which may be missing, in bytes.
const MEASURED: f64 = 2.0 * NUMBER;
/// The largest whole number among the options of a plugin.
const LARGEST: i64 = i32::MAX as i64;
/// Whole numbers that are no sizes, by their names.
const NO_SIZES: [&str; 2] = ["seed", "id"];

/// Memory needed by one size.
struct Need {
    /// Path of the key that sets the size, from the root of the study.
    key: String,
    /// The objects that need the memory, as the subject of the message.
    what: &'static str,
    /// The value of the key.
    size: f64,
    /// The memory that this size takes, in bytes.
    bytes: f64,
    /// Size of the files that contain it, in bytes.
    written: f64,
}

/// Memory that a study needs at least.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    /// Memory of all parts, in bytes.
    pub bytes: f64,
    /// The largest part, such as `the runs`.
    pub largest: &'static str,
    /// Key in the study that sets the size of this part.
    pub key: String,
    /// Memory of this part, in bytes.
    pub part: f64,
}

impl Memory {
    /// The memory that a study with so many measured values needs; `None` if it states no size.
    pub fn of(study: &Study, measured: usize) -> Option<Self> {
        let mut needs = needs(study);
        let bytes = MEASURED * measured as f64;
        needs.push(Need {
            key: "measurements".to_owned(),
            what: "the measured values",
            size: measured as f64,
            bytes,
            written: 0.0,
        });
        let bytes = needs.iter().map(|need| need.bytes).sum();
        let largest = needs.into_iter().max_by(|a, b| a.bytes.total_cmp(&b.bytes))?;
        let Need { key, what, bytes: part, .. } = largest;
        (bytes > 0.0).then_some(Self { bytes, largest: what, key, part })
    }

    /// An error if this machine has less.
    pub fn fits(&self) -> Result<(), String> {
        match of_machine() {
            Some(memory) if self.bytes > memory => {
                Err(format!("{self}; this machine has {}", amount(memory)))
            }
            _ => Ok(()),
        }
    }
}

/// Refuses a study whose files do not fit into the free space of a disk, in bytes.
pub fn fits_on_disk(study: &Study, free: f64) -> Result<(), String> {
    let needs = needs(study);
    let written: f64 = needs.iter().map(|need| need.written).sum();
    let Some(largest) = needs.into_iter().max_by(|a, b| a.written.total_cmp(&b.written)) else {
        return Ok(());
    };
    if written <= free {
        return Ok(());
    }
    let Need { key, what, written: part, .. } = largest;
    let [written, part, free] = [written, part, free].map(amount);
    Err(format!(
        "the study writes {written}, and {free} are free; the largest part: {what}, {part} (`{key}`)"
    ))
}

impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bytes, largest, key, part } = self;
        let (all, part) = (amount(*bytes), amount(*part));
        write!(f, "the study needs {all} of memory; the largest part: {largest}, {part} (`{key}`)")
    }
}

/// Reports a response that is too large, all its axes together.
pub(super) fn response(places: impl Iterator<Item = usize>, node: &Node, problems: &mut Problems) {
    let values: f64 = places.map(|n| n as f64).product();
    if NUMBER * values > MOST {
        let most = MOST / NUMBER;
        Complaints::new(node, problems)
            .at("axes")
            .say(format!("one response needs {} of memory", amount(NUMBER * values)))
            .expected(format!("at most {most} values, the product of the axes"))
            .found(values);
    }
}

/// Reports every size that no machine can hold.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let before = problems.len();
    for (section, options) in study.options() {
        let mut found = Vec::new();
        too_large(options, "", &mut found);
        for (key, value) in found {
            Complaints::new(root, problems)
                .at(&format!("{section}.{key}"))
                .say(format!("`{key}` is no possible size"))
                .expected(format!("at most {LARGEST}"))
                .found(value);
        }
    }
    if problems.len() == before {
        refuse(study, MOST, "a study may ask for", root, problems);
    }
}

/// Reports every size that this machine cannot hold, or else that it cannot hold all of them together.
pub(super) fn environment(study: &Study, root: &Node, problems: &mut Problems) {
    let Some(memory) = of_machine() else { return };
    let before = problems.len();
    refuse(study, memory, "this machine has", root, problems);
    if problems.len() > before {
        return;
    }
    if let Some(needed) = Memory::of(study, 0)
        && let Err(said) = needed.fits()
    {
        Complaints::new(root, problems).at(&needed.key).say(said);
    }
}

fn refuse(study: &Study, most: f64, whose: &str, root: &Node, problems: &mut Problems) {
    let mut complaints = Complaints::new(root, problems);
    for need in needs(study).into_iter().filter(|need| need.bytes > most) {
        let Need { key, what, size, bytes, .. } = need;
        complaints
            .at(&key)
            .say(format!("{what} need {} of memory; {whose} {}", amount(bytes), amount(most)))
            .expected(format!("at most {}", (size * (most / bytes)).floor()))
            .found(size);
    }
}

/// Everything in a study that is a size, with what it asks for.
fn needs(study: &Study) -> Vec<Need> {
    let mut needs = Vec::new();
    let mut add = |key: &str, what, size: usize, numbers: f64, written: f64| {
        let (size, key) = (size as f64, key.to_owned());
        let [bytes, written] = [numbers, written].map(|each| NUMBER * size * each);
        needs.push(Need { key, what, size, bytes, written });
    };
    let parameters = study.parameters.len() as f64;
    let outputs = study.layouts.len() as f64;
    // The responses of a run, its parameters, and the response once more where the ensemble is read.
    let derived = study.surrogate.as_ref().is_some_and(|section| section.common.gradients);
    let slopes = if derived { 2.0 * outputs * parameters } else { 0.0 };
    let run = parameters + 2.0 * outputs + slopes;
    let kept = parameters + outputs + slopes / 2.0;
    if let Some(design) = &study.design {
        add("design.runs", "the runs", design.common.runs.get(), run, kept);
        for (i, more) in design.common.extended.iter().enumerate() {
            add(&format!("design.extended.{i}"), "the runs", more.get(), run, kept);
        }
    }
    if let Some(refine) = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref()) {
        let (runs, rounds) = (refine.runs.get(), refine.rounds.get());
        // The larger of the two is the one to lower.
        let (key, size, times) = if runs >= rounds {
            ("surrogate.refine.runs", runs, rounds as f64)
        } else {
            ("surrogate.refine.rounds", rounds, runs as f64)
        };
        add(key, "the runs of all rounds", size, times * run, times * kept);
    }
    if let Some(error) = &study.numerical_error {
        add("numerical_error.runs", "the finer runs", error.runs, run, kept);
    }
    if let Some(draws) = study.propagated() {
        // The values of all quantities in a few variants, and the inputs.
        let asked = study.quantities.len() as f64;
        add("forward.draws", "the draws", draws, parameters + 10.0 * asked, parameters + asked);
        if !study.intervals().is_empty() {
            // The figures and the bounds of the distribution of each quantity.
            let search = study.interval_search();
            add(
                "forward.intervals.points",
                "the points",
                search.points,
                parameters + 50.0 * asked,
                0.0,
            );
            add("forward.intervals.draws", "the draws", search.draws, parameters + asked, 0.0);
        }
    }
    add("validate.emulator_check", "the runs", study.validate.emulator_check, run, 0.0);
    if let Some(section) = &study.sampler {
        let plan = section.built.plugin.plan(study.parameters.len());
        let steps = section.built.plugin.uses_starts() && plan.warm_up < plan.steps;
        let Plan { chains, steps, .. } = Plan { steps: if steps { plan.steps } else { 1 }, ..plan };
        // The draws twice, as they are read and as they are kept, each with its log density.
        let numbers = 2.0 * (parameters + 1.0) * chains as f64 * steps as f64;
        if let Some((key, size)) = largest(&section.built.options) {
            let key = format!("sampler.{key}");
            let each = numbers / (size as f64).max(1.0);
            // As the sampler writes them, as the stage keeps them, and in `posterior.nc`.
            add(&key, "the draws", size as usize, each, 1.5 * each);
        }
        let sizes = section.built.plugin.room(study.parameters.len());
        needs.extend(sizes.into_iter().map(|size| within("sampler", size)));
    }
    // Probabilities are estimated one after the other.
    needs.extend(reliability(study).max_by(|a, b| a.bytes.total_cmp(&b.bytes)));
    needs
}

/// Memory of the methods of `[[reliability]]`, by their options.
fn reliability(study: &Study) -> impl Iterator<Item = Need> {
    let unknowns = study.parameters.len();
    study.reliability.iter().flat_map(move |section| {
        let path = format!("reliability.{}", section.common.name.as_str());
        let sizes = section.built.plugin.room(unknowns).into_iter();
        sizes.map(move |size| within(&path, size))
    })
}

/// Memory of a plugin by one of its options, which stand at this path.
fn within(path: &str, size: Size) -> Need {
    let Size { key, what, value, numbers } = size;
    let bytes = NUMBER * value as f64 * numbers as f64;
    Need { key: format!("{path}.{key}"), what, size: value as f64, bytes, written: 0.0 }
}

/// The largest whole number among options.
fn largest(options: &toml::Table) -> Option<(&str, i64)> {
    let sizes = options.iter().filter(|(key, _)| !NO_SIZES.contains(&key.as_str()));
    let whole = sizes.filter_map(|(key, value)| Some((key.as_str(), value.as_integer()?)));
    whole.max_by_key(|(_, n)| *n)
}

/// The whole numbers among options that are no possible sizes, with their dotted paths.
fn too_large(options: &toml::Table, path: &str, found: &mut Vec<(String, i64)>) {
    for (key, value) in options.iter().filter(|(key, _)| !NO_SIZES.contains(&key.as_str())) {
        look(value, &format!("{path}{key}"), found);
    }
}

fn look(value: &toml::Value, path: &str, found: &mut Vec<(String, i64)>) {
    match value {
        toml::Value::Integer(n) if *n > LARGEST => found.push((path.to_owned(), *n)),
        toml::Value::Table(table) => too_large(table, &format!("{path}."), found),
        toml::Value::Array(items) => {
            items
                .iter()
                .enumerate()
                .for_each(|(i, item)| look(item, &format!("{path}.{i}"), found));
        }
        _ => {}
    }
}

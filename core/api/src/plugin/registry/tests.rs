#![allow(clippy::unwrap_used)]

use std::path::Path;

use lacuna_base::text::read::read;
use lacuna_base::text::values::{Count, Fraction};
use lacuna_base::text::{Complaints, Sources};

use super::*;

/// A kind of plugin that exists in these tests only.
pub(crate) trait Instrument: Send + Sync {
    fn sound(&self) -> String;
    fn check(&self, _: &mut Complaints<'_>) {}
}

crate::kind!(Instrument, "instrument", ["instrument"]);

/// A whistle. It has one hole
/// more than a flute.
///
/// Blow gently:
///
/// ```toml
/// [instrument]
/// use = "whistle"
/// ```
///
/// - first
/// - second
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Whistle {
    /// Loudness of the note,
    /// as a share of the loudest.
    volume: Fraction,
    /// The holes.
    holes: Option<Count>,
    /// Tuning of the whistle.
    tuning: Tuning,
    case: Case,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Tuning {
    /// As the piano is.
    Equal,
    /// As the ear likes it.
    Just {
        /// The lowest note.
        root: f64,
    },
}

/// Case of the whistle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Case {
    /// Material of the case.
    material: String,
}

impl Default for Case {
    fn default() -> Self {
        Self { material: "wood".into() }
    }
}

impl Default for Whistle {
    fn default() -> Self {
        let volume = Fraction::new(0.5).unwrap();
        Self { volume, holes: None, tuning: Tuning::Equal, case: Case::default() }
    }
}

impl Instrument for Whistle {
    fn sound(&self) -> String {
        format!("fweet at {}", self.volume)
    }

    fn check(&self, complaints: &mut Complaints<'_>) {
        let problem = complaints.at("volume").say("the neighbours are asleep");
        problem.found(self.volume).expected("at most 0.1").help("whisper");
        complaints.at("tuning.just.root").say("no root").help("plant one");
    }
}

/// Drums need no options but one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(crate) struct Drum {
    /// Number of sticks.
    sticks: Count,
}

impl Instrument for Drum {
    fn sound(&self) -> String {
        "boom".into()
    }
}

crate::register!(Instrument, "whistle", Whistle);
crate::register!(Instrument, "drum", Drum);

mod elsewhere {
    use super::{Drum, Instrument};

    crate::register!(Instrument, "drum", Drum);
}

#[derive(Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Concert {
    /// Number of listeners.
    audience: usize,
}

struct Outcome {
    section: Option<Section<dyn Instrument, Concert>>,
    shown: String,
}

fn section_of(text: &str, default: Option<&str>) -> Outcome {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let id = sources.add_file(Path::new("s.toml"), text.to_owned());
    let node = read(id, &sources, &mut problems).unwrap();
    let instrument = node.get("instrument").unwrap();
    let section = problems.within("instrument", |problems| {
        let section = section::<dyn Instrument, Concert>(instrument, default, problems);
        if let Some(section) = &section {
            section.built.plugin.check(&mut Complaints::new(instrument, problems));
        }
        section
    });
    assert!(problems.sorted().iter().all(|problem| problem.path.starts_with("instrument")));
    Outcome { section, shown: problems.render(&sources) }
}

#[test]
fn plugins_are_found_by_name_and_sorted() {
    let names: Vec<&str> = entries::<dyn Instrument>().iter().map(|entry| entry.name).collect();
    assert_eq!(names, ["drum", "drum", "whistle"]);
    let whistle = find::<dyn Instrument>("whistle").unwrap();
    assert_eq!(whistle.full_name(), "instrument.whistle");
    assert_eq!(whistle.module_path, module_path!());
    let problem = find::<dyn Instrument>("wistle").map(|entry| entry.name).unwrap_err();
    assert_eq!(problem.message, "there is no instrument `wistle`");
    assert_eq!(problem.help, ["did you mean `whistle`?"]);
    let kinds: Vec<&str> = kinds().iter().map(|kind| kind.name).collect();
    for kind in ["reader", "design", "model", "executor", "surrogate", "sampler", "effect"] {
        assert!(kinds.contains(&kind), "{kind}");
    }
}

#[test]
fn a_name_in_two_places_is_reported() {
    let problems = audit();
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].message, "two plugins are called `instrument.drum`");
    let here = module_path!();
    assert_eq!(problems[0].found, Some(format!("`{here}` and `{here}::elsewhere`")));
}

#[test]
fn a_section_is_decoded_in_two_parts() {
    let text = "[instrument]\nuse = 'whistle'\naudience = 7\nvolume = 0.25\n";
    let Outcome { section, .. } = section_of(text, None);
    let Section { common, built } = section.unwrap();
    assert_eq!(common.audience, 7);
    assert_eq!(built.name, "whistle");
    assert_eq!(built.plugin.sound(), "fweet at 0.25");
    // A default of `None` corresponds to an absent key.
    let defaults = "volume = 0.25\ntuning = \"equal\"\n\n[case]\nmaterial = \"wood\"\n";
    assert_eq!(emit::to_toml(&built.options).unwrap(), defaults);
    let by_default = section_of("[instrument]\nvolume = 1", Some("whistle"));
    assert_eq!(by_default.section.unwrap().built.plugin.sound(), "fweet at 1.0");
}

#[test]
fn both_parts_of_a_section_complain_at_once() {
    let text = "[instrument]\nuse = 'whistle'\naudience = -7\nvolum = 0.25\nholes = 0\n";
    let outcome = section_of(text, None);
    assert!(outcome.section.is_none());
    let expected = "\
s.toml:3:12: wrong value for `audience`
  |
3 | audience = -7
  |            ^^
  = expected a whole number of 0 or more, found -7

s.toml:4:1: unknown key `volum`
  |
4 | volum = 0.25
  | ^^^^^
  = expected one of `volume`, `holes`, `tuning`, `case`, `use` or `audience`
  = help: did you mean `volume`?

s.toml:5:9: wrong value for `holes`
  |
5 | holes = 0
  |         ^
  = expected a whole number of 1 or more, found 0
";
    assert_eq!(outcome.shown, expected);
}

#[test]
fn a_plugin_can_be_made_without_a_study() {
    let whistle = from_text::<dyn Instrument>("whistle", "volume = 1").unwrap();
    assert_eq!(whistle.plugin.sound(), "fweet at 1.0");
    let said = from_text::<dyn Instrument>("whistle", "volume = 2").map(|built| built.name);
    assert!(said.unwrap_err().starts_with("instrument.whistle: wrong value for `volume`\n"));
    let said = from_text::<dyn Instrument>("wistle", "volume = 2").map(|built| built.name);
    assert!(said.unwrap_err().starts_with("instrument.wistle: there is no instrument `wistle`\n"));
}

#[test]
fn a_missing_or_unknown_plugin_is_shown() {
    let shown = section_of("[instrument]\nuse = 'wistle'\n", None).shown;
    let expected = "\
s.toml:2:7: there is no instrument `wistle`
  |
2 | use = 'wistle'
  |       ^^^^^^^^
  = expected `drum` or `whistle`
  = help: did you mean `whistle`?
";
    assert_eq!(shown, expected);
    let shown = section_of("[instrument]\nvolume = 1\n", None).shown;
    assert!(shown.starts_with("s.toml:1:1: missing key `use`\n"), "{shown}");
    let shown = section_of("instrument = 3\n", None).shown;
    assert!(shown.contains("expected a table, found 3"), "{shown}");
    let shown = section_of("[instrument]\nuse = 3\n", None).shown;
    assert_eq!(shown.matches("s.toml").count(), 1, "{shown}");
}

#[test]
fn plugins_complain_about_their_own_keys() {
    let text = "[instrument]\nuse = 'whistle'\nvolume = 0.25\ntuning = { just = { root = 1 } }\n";
    let expected = "\
s.toml:3:10: the neighbours are asleep
  |
3 | volume = 0.25
  |          ^^^^
  = expected at most 0.1, found 0.25
  = help: whisper

s.toml:4:28: no root
  |
4 | tuning = { just = { root = 1 } }
  |                            ^
  = help: plant one
";
    assert_eq!(section_of(text, None).shown, expected);
    // A default has no place in the text, so the section is reported.
    let shown = section_of("[instrument]\nuse = 'whistle'\n", None).shown;
    assert!(shown.starts_with("s.toml:1:1: the neighbours are asleep\n"), "{shown}");
}

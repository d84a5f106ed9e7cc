#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::*;
use crate::data::Unit;
use crate::text::read::read;
use crate::text::source::Sources;
use crate::text::values::{Count, Fraction, Interval, Name, Positive};

/// Decodes a text; returns the value, or the problems as shown to the user.
fn decoded<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let id = sources.add_file(Path::new("s.toml"), text.to_owned());
    let node = read(id, &sources, &mut problems);
    let value = node.and_then(|node| decode::<T>(&node, &mut problems));
    assert_eq!(value.is_none(), !problems.is_empty());
    value.ok_or_else(|| problems.render(&sources))
}

/// First lines of the problems, without the file name.
fn heads<T: DeserializeOwned>(text: &str) -> Vec<String> {
    let Err(shown) = decoded::<T>(text) else { return Vec::new() };
    let heads = shown.lines().filter_map(|line| line.strip_prefix("s.toml"));
    heads.map(|line| line.trim_start_matches(':').trim_start().to_owned()).collect()
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Prior {
    Uniform(Interval),
    Normal { mean: f64, sd: Positive },
    Flat,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(default)]
struct Degree {
    max: Count,
    interaction: Option<usize>,
}

impl Default for Degree {
    fn default() -> Self {
        Self { max: Count::new(3).unwrap(), interaction: None }
    }
}

fn some_steps() -> u32 {
    10
}

#[derive(Debug, PartialEq, Deserialize)]
struct Options {
    walkers: usize,
    #[serde(default = "some_steps")]
    steps: u32,
    burn_in: Option<Fraction>,
    prior: Prior,
    #[serde(default)]
    degree: Degree,
    #[serde(default)]
    names: Vec<Name>,
    #[serde(default)]
    scale: BTreeMap<String, f64>,
    unit: Option<Unit>,
}

#[test]
fn what_is_right_is_decoded() {
    let text = "walkers = 1e3\nprior.uniform = [0, 1]\nburn_in = 1\nnames = ['a', 'b']\n\
                unit = 'm/s2'\n[degree]\nmax = 20\n[scale]\nx = 1\ny = 2.5\n";
    let options: Options = decoded(text).unwrap();
    assert_eq!(options.walkers, 1000);
    assert_eq!(options.steps, 10);
    assert_eq!(options.prior, Prior::Uniform(Interval::new(0.0, 1.0).unwrap()));
    assert_eq!(options.degree.max.get(), 20);
    assert_eq!(options.scale["x"], 1.0);
    assert_eq!(options.unit.unwrap(), Unit::parse("m/s^2").unwrap());
    let flat: BTreeMap<String, Prior> =
        decoded("a = 'flat'\nb = { flat = {} }\nc = { normal = { mean = 0, sd = 1 } }").unwrap();
    assert_eq!(flat["a"], flat["b"]);
}

#[test]
fn every_problem_is_shown_with_its_place() {
    let text = "walkrs = 12\nsteps = \"many\"\nburn_in = 1.5\nprior = { unifrm = [0, 1] }\n\
                names = [\"ok\", \"not ok\", 3]\nunit = \"m/sec\"\n\n[degree]\nmax = 0\nmin = 1\n\n\
                [scale]\nx = \"big\"\ny = nan\n";
    let expected = "\
s.toml:1:1: unknown key `walkrs`
  |
1 | walkrs = 12
  | ^^^^^^
  = expected one of `walkers`, `steps`, `burn_in`, `prior`, `degree`, `names`, `scale` or `unit`
  = help: did you mean `walkers`?

s.toml:2:9: wrong value for `steps`
  |
2 | steps = \"many\"
  |         ^^^^^^
  = expected a whole number, found \"many\"

s.toml:3:11: wrong value for `burn_in`
  |
3 | burn_in = 1.5
  |           ^^^
  = expected a fraction between 0 and 1, found 1.5

s.toml:4:11: unknown choice `unifrm`
  |
4 | prior = { unifrm = [0, 1] }
  |           ^^^^^^
  = expected one of `uniform`, `normal` or `flat`
  = help: did you mean `uniform`?

s.toml:5:16: wrong value for `names.1`
  |
5 | names = [\"ok\", \"not ok\", 3]
  |                ^^^^^^^^
  = expected a name of letters, digits and `_` that does not begin with a digit, found \"not ok\"

s.toml:5:26: wrong value for `names.2`
  |
5 | names = [\"ok\", \"not ok\", 3]
  |                          ^
  = expected a string, found 3

s.toml:6:8: wrong value for `unit`
  |
6 | unit = \"m/sec\"
  |        ^^^^^^^
  = expected a unit such as `m/s2`, found \"m/sec\"
  = help: `sec` is not a unit known here; did you mean `s`?

s.toml:9:7: wrong value for `degree.max`
  |
9 | max = 0
  |       ^
  = expected a whole number of 1 or more, found 0

s.toml:10:1: unknown key `min`
   |
10 | min = 1
   | ^^^
   = expected one of `max` or `interaction`

s.toml:13:5: wrong value for `scale.x`
   |
13 | x = \"big\"
   |     ^^^^^
   = expected a number, found \"big\"

s.toml:14:5: wrong value for `scale.y`
   |
14 | y = nan
   |     ^^^
   = expected a finite number, found nan
";
    let shown = decoded::<Options>(text).unwrap_err();
    assert_eq!(shown, expected, "{shown}");
}

/// A line of any length is shown about the place of the problem.
#[test]
fn of_a_long_line_a_part_is_shown() {
    let names = "1, ".repeat(30_000);
    let text = format!("prior = {{ uniform = [0, 1] }}\nnames = [{names}]\nwalkers = 1");
    let shown = decoded::<Options>(&text).unwrap_err();
    let first: Vec<&str> = shown.lines().take(4).collect();
    assert_eq!(first[0], "s.toml:2:10: wrong value for `names.0`");
    assert!(first[2].starts_with("2 | names = [1, 1,") && first[2].ends_with('…'), "{}", first[2]);
    let last = format!("steps = {}\"many\"", " ".repeat(70_000));
    let shown = decoded::<Options>(&last).unwrap_err();
    let lines: Vec<&str> = shown.lines().collect();
    let at = lines.iter().position(|line| line.ends_with("\"many\"")).unwrap();
    assert!(lines[at].starts_with("1 | … "), "{}", lines[at]);
    let [text, carets] = [lines[at], lines[at + 1]].map(|line| line.chars().collect::<Vec<_>>());
    let first = carets.iter().position(|c| *c == '^').unwrap();
    assert_eq!(text[first..].iter().collect::<String>(), "\"many\"");
}

/// Thousands of unknown keys are read in a moment, and not all shown.
#[test]
fn of_thousands_of_problems_some_are_shown() {
    let keys: String = (0..20_000).map(|i| format!("key{i} = 1\n")).collect();
    let shown = decoded::<Options>(&keys).unwrap_err();
    assert_eq!(shown.matches("unknown key").count(), MOST);
    assert!(shown.contains("further problems here are not shown, after 500"));
}

#[test]
fn all_missing_keys_are_named() {
    assert_eq!(heads::<Options>("steps = 3"), ["missing key `walkers`", "missing key `prior`"]);
    // A missing key of an inner table does not hide the faults after it.
    let text = "prior = { normal = { sd = 0 } }\nwalkers = -1";
    let expected = [
        "1:20: missing key `mean`",
        "1:27: wrong value for `prior.normal.sd`",
        "2:11: wrong value for `walkers`",
    ];
    assert_eq!(heads::<Options>(text), expected);
}

#[test]
fn what_follows_from_a_problem_is_not_reported() {
    // One bound of the interval remains and the prior is empty: neither is reported again.
    let text = "walkers = 1\nprior = { uniform = [0, 'x'] }";
    assert_eq!(heads::<Options>(text), ["2:25: wrong value for `prior.uniform.1`"]);
    let text = "walkers = 'x'\nprior = { uniform = [2, 1] }";
    assert_eq!(
        heads::<Options>(text),
        ["1:11: wrong value for `walkers`", "2:21: wrong value for `prior.uniform`"]
    );
}

#[test]
fn an_unknown_key_hides_no_other_problem() {
    let text = "walkers = 1\nstepz = 2\nprior = { uniform = [2, 1] }\n[degree]\nx = 1\nmax = 0";
    let heads = heads::<Options>(text);
    assert_eq!(heads.len(), 4, "{heads:?}");
}

#[test]
fn choices_say_how_they_are_written() {
    let shown = decoded::<BTreeMap<String, Prior>>(
        "a = 'uniform'\nb = { flat = 1 }\nc = {}\nd = { flat = {}, normal = {} }\ne = 1\nf = 'normal'",
    )
    .unwrap_err();
    for line in [
        "  = expected `uniform` with its value, found the name alone",
        "  = help: write `{ uniform = … }`",
        "  = expected `flat` alone, found 1",
        "  = expected one of the keys `uniform`, `normal` or `flat`, found an empty table",
        "  = expected one of the keys `uniform`, `normal` or `flat`, found more than one key",
        "  = expected one of `uniform`, `normal` or `flat`, found 1",
        "  = expected `normal` with its keys, found the name alone",
        "  = help: write `{ normal = { mean = … } }`",
    ] {
        assert!(shown.lines().any(|l| l == line), "{line}\n{shown}");
    }
}

#[test]
fn numbers_keep_their_meaning() {
    type Wholes = BTreeMap<String, u8>;
    assert_eq!(decoded::<Wholes>("a = 2e2").unwrap()["a"], 200);
    assert_eq!(heads::<Wholes>("a = 1.5\nb = 300\nc = -1\nd = 1e300").len(), 4);
    let shown = decoded::<Wholes>("b = 300").unwrap_err();
    assert!(shown.contains("expected a whole number from 0 to 255, found 300"), "{shown}");
    assert_eq!(
        decoded::<BTreeMap<String, u64>>("a = 9223372036854775807").unwrap()["a"],
        i64::MAX as u64
    );
    assert_eq!(
        heads::<BTreeMap<String, u64>>("a = 9223372036854775808\nb = 1e999"),
        ["1:5: the whole number is too large", "2:5: the number is too large"]
    );
}

#[test]
fn a_type_may_ask_for_any_number() {
    #[derive(Debug)]
    struct Bound(f64);
    impl<'de> Deserialize<'de> for Bound {
        fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
            struct Any;
            impl serde::de::Visitor<'_> for Any {
                type Value = Bound;
                fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                    f.write_str("a number or `inf`")
                }
                fn visit_f64<E>(self, x: f64) -> Result<Bound, E> {
                    Ok(Bound(x))
                }
            }
            d.deserialize_any(Any)
        }
    }
    assert_eq!(decoded::<BTreeMap<String, Bound>>("a = -inf").unwrap()["a"].0, f64::NEG_INFINITY);
    let shown = decoded::<BTreeMap<String, Bound>>("a = 'b'").unwrap_err();
    assert!(shown.contains("= expected a number or `inf`, found \"b\""), "{shown}");
}

#[test]
fn buffered_types_are_placed_at_the_value_that_holds_them() {
    #[derive(Debug, Deserialize)]
    #[serde(untagged)]
    #[allow(dead_code)]
    enum Either {
        Number(f64),
        Names(Vec<String>),
    }
    let shown = decoded::<BTreeMap<String, Either>>("a = 1\nb = ['x']\nc = true").unwrap_err();
    assert!(shown.starts_with("s.toml:3:5: "), "{shown}");
}

/// A valid text with one byte removed, doubled or replaced is decoded or rejected with problems whose places lie inside
/// the text; it never panics or loops.
#[test]
fn spoilt_texts_are_complained_about() {
    let text = "walkers = 12\nprior = { normal = { mean = 0, sd = 1 } }\nburn_in = 0.5\n\
                names = ['a', 'b']\nunit = 'm/s2'\n[degree]\nmax = 20\n[scale]\nx = 1\n";
    assert!(decoded::<Options>(text).is_ok());
    let mut complaints = 0;
    for at in 0..text.len() {
        for byte in ["", "x", "1", "-", ".", "'", "{", "]", "=", "\n", "µ", "#"] {
            let spoilt = format!("{}{byte}{}", &text[..at], &text[at + 1..]);
            complaints += usize::from(decoded::<Options>(&spoilt).is_err());
        }
    }
    assert!(complaints > 1000, "{complaints}");
}

#[test]
fn syntax_errors_come_together() {
    let heads = heads::<BTreeMap<String, f64>>("a = \nb = 1\nc = [1, \nd = = 2\nb = 3\n");
    assert!(heads.len() >= 3, "{heads:?}");
}

#[test]
fn keys_that_belong_to_the_engine_are_known() {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let id = sources.add_file(Path::new("s.toml"), "trainng = 4".into());
    let node = read(id, &sources, &mut problems).unwrap();
    assert_eq!(decode_beside::<Degree>(&node, &["use", "training"], &mut problems), None);
    let shown = problems.render(&sources);
    assert!(shown.contains("expected one of `max`, `interaction`, `use` or `training`"), "{shown}");
    assert!(shown.contains("did you mean `training`?"), "{shown}");
    assert_eq!(fields::<Degree>(), ["max", "interaction"]);
    assert!(fields::<f64>().is_empty());
}

#[test]
fn a_type_may_name_unknown_and_missing_keys_itself() {
    #[derive(Debug)]
    struct Picky;
    impl<'de> Deserialize<'de> for Picky {
        fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
            use serde::de::Error;
            let keys = BTreeMap::<String, f64>::deserialize(d)?;
            if keys.contains_key("a") {
                return Err(D::Error::unknown_field("a", &["b"]));
            }
            Err(D::Error::missing_field("b"))
        }
    }
    assert_eq!(heads::<Picky>("a = 1"), ["unknown key `a`"]);
    assert_eq!(heads::<Picky>("c = 1"), ["missing key `b`"]);
    assert_eq!(heads::<BTreeMap<String, Box<Picky>>>("x = { a = 1 }\ny = 2").len(), 2);
}

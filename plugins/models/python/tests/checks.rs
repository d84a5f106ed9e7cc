//! Complaints about a Python file before anything runs.

use lacuna::data::{Layout, Unit};
use lacuna::plugin::{Context, Given};
use lacuna::text::problem::Complaints;
use lacuna::text::{Node, Place, Problems, Sources};

use super::{Case, LINES};

/// The complaints of a model whose study has the inputs `a` and `b`.
fn complaints(text: &str, options: &str) -> Option<String> {
    let case = Case::new(text, options)?;
    let given = ["a", "b"].map(|name| Given { name: name.to_owned(), unit: None });
    let layout = Layout::number("y");
    let context = Context { given: &given, ..Context::new(case.study.path(), &[], &layout) };
    let mut sources = Sources::default();
    let node = Node::table(Place::whole(sources.add_argument("model", String::new())));
    let mut problems = Problems::new();
    case.model.environment(&context, &mut Complaints::new(&node, &mut problems));
    case.model.check(&context, &mut Complaints::new(&node, &mut problems));
    let folder = format!("{}/", case.study.path().display());
    let said = problems.sorted().into_iter().map(|problem| {
        let part = |name: &str, text: &Option<String>| {
            text.as_ref().map_or(String::new(), |text| format!(" | {name} {text}"))
        };
        let (expected, found) =
            (part("expected", &problem.expected), part("found", &problem.found));
        let help: String = problem.help.iter().map(|help| format!(" | {help}")).collect();
        format!("{}: {}{expected}{found}{help}\n", problem.path, problem.message)
    });
    Some(said.collect::<String>().replace(&folder, ""))
}

#[test]
fn a_file_is_looked_at_without_being_run() {
    let fatal = "raise SystemExit\n";
    for (text, options, said) in [
        (LINES, "", ""),
        ("from somewhere import simulate", "", ""),
        ("from somewhere import *", "", ""),
        ("@decorated\ndef simulate(): pass", "", ""),
        ("def simulate(a, layout, scenario, b=1, c=2): pass", "", ""),
        ("def simulate(*, a, **others): pass", "", ""),
        ("simulate = lambda a, b: 0", "", ""),
        (
            "def simulatr(): pass\ndef other(): pass",
            "",
            "function: model.py has no function `simulate` | expected one of `simulatr`, `other` | did you mean `simulatr`?\n",
        ),
        (
            "def simulate(a, bb, *, c): pass",
            "",
            "function: `simulate` has no argument for the input `b` | did you mean `bb`?\n\
             function: `simulate` requires the argument `bb`, which is not an input of the study | expected one of `a`, `b`\n\
             function: `simulate` requires the argument `c`, which is not an input of the study | expected one of `a`, `b`\n",
        ),
        (
            LINES,
            "gradient = 'slopes'",
            "gradient: model.py has no function `slopes` | expected `simulate`\n",
        ),
        ("a = 1\ndef simulate(:", "", "file: model.py:2: invalid syntax\n"),
        (
            LINES,
            "units = { speed = 'm' }",
            "units.speed: the study gives no input `speed` | expected one of `a`, `b`\n",
        ),
    ] {
        let text = format!("{text}\n{}", if said.contains("syntax") { "" } else { fatal });
        let Some(found) = complaints(&text, options) else { return };
        assert_eq!(found, said, "{text}");
    }
}

#[test]
fn units_of_the_inputs_are_those_that_are_asked_for() {
    let Some(case) = Case::new(LINES, "units = { a = 'g/cm3' }") else { return };
    let unit = |text: &str| Unit::parse(text).unwrap();
    let given = [("a", Some(unit("kg/m3"))), ("b", Some(unit("m"))), ("c", None)];
    let given = given.map(|(name, unit)| Given { name: name.to_owned(), unit });
    let layout = Layout::number("y");
    let context = Context { given: &given, ..Context::new(case.study.path(), &[], &layout) };
    let signature = case.model.signature(&context);
    let units: Vec<Unit> = signature.inputs.into_iter().map(|input| input.unit).collect();
    assert_eq!(units, [unit("g/cm3"), unit("m"), Unit::dimensionless()]);
}

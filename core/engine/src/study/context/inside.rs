//! Consistency of the candidates inside the model (`[[gap.switch]]`, `[[gap.term]]`, `[[gap.model]]`) with the rest of
//! the study.

use lacuna::data::Unit;
use lacuna::plugin::amend::State;
use lacuna::plugin::model::Signature;
use lacuna::plugin::registry::Section;
use lacuna::plugin::term::Place;
use lacuna::plugin::{Context, Given, Term};
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::problem::Problem;
use lacuna::text::{Complaints, Node, Problems};

use crate::study::Study;
use crate::study::gap::{Held, Loose, Swap, SwitchSection, TermKeys, hold};

/// Reports inputs, states and models that do not fit; `gap` is the section.
pub(super) fn check(study: &Study, gap: &Node, problems: &mut Problems) {
    let inside = &study.gap.inside;
    if inside.is_empty() {
        return;
    }
    let nodes = |list: &str| gap.get(list).map(Node::elements).unwrap_or_default();
    if !makes_runs(study, gap, problems) {
        return;
    }
    for (i, (switch, node)) in inside.switches.iter().zip(nodes("switch")).enumerate() {
        let twice = inside.switches[..i].iter().any(|other| other.input == switch.input);
        problems.within("switch", |problems| {
            one_switch(study, switch, twice, &mut Complaints::new(node, problems));
        });
    }
    for (i, (term, node)) in inside.terms.iter().zip(nodes("term")).enumerate() {
        let twice = inside.terms[..i].iter().any(|other| name(other) == name(term));
        problems.within("term", |problems| {
            one_term(study, term, twice, &mut Complaints::new(node, problems));
        });
    }
    for (swap, node) in inside.models.iter().zip(nodes("model")) {
        problems.within("model", |problems| {
            one_model(study, swap, &mut Complaints::new(node, problems));
        });
    }
}

/// Reports places of inputs of the study's own model, which are not interpolated.
pub(super) fn no_places(study: &Study, gap: &Node, problems: &mut Problems) {
    let nodes = gap.get("switch").map(Node::elements).unwrap_or_default();
    for (switch, node) in study.gap.inside.switches.iter().zip(nodes) {
        if switch.place.is_some() {
            problems.within("switch", |problems| {
                Complaints::new(node, problems)
                    .at("place")
                    .say("places are known to `[[gap.companion.switch]]` alone")
                    .help("take `place` out: each input is a candidate by itself");
            });
        }
    }
}

/// Returns true if the study has a model and, with a surrogate, a design for further training runs; reports what is
/// missing.
fn makes_runs(study: &Study, gap: &Node, problems: &mut Problems) -> bool {
    let list = ["switch", "term", "model"].into_iter().find(|list| gap.get(list).is_some());
    let list = list.unwrap_or_default();
    let mut complaints = Complaints::new(gap, problems);
    if study.model.is_none() {
        complaints
            .at(list)
            .say(format!("`[[gap.{list}]]` needs a model"))
            .help("add `[model]`, or take it out");
        return false;
    }
    if study.surrogate.is_some() && study.design.is_none() {
        complaints
            .at(list)
            .say(format!("`[[gap.{list}]]` needs runs of its own, and the study has no `[design]`"))
            .help("add `[design]`: the surrogate learns from further runs what changes");
        return false;
    }
    true
}

fn one_switch(study: &Study, switch: &SwitchSection, twice: bool, complaints: &mut Complaints<'_>) {
    let input = &switch.input;
    if twice {
        complaints.at("input").say(format!("`{input}` is set free twice")).help("take one out");
        return;
    }
    match hold(study, input) {
        Ok(held) => fits(switch, &held, complaints),
        Err(Loose::Unknown(names)) => {
            let names = || names.iter().map(String::as_str);
            let near = nearest(input, names());
            let problem: &mut Problem =
                complaints.at("input").say(format!("the model has no input `{input}`"));
            problem.expected(one_of(names()));
            if let Some(near) = near {
                problem.help(format!("did you mean `{near}`?"));
            }
            if study.takes(input) {
                problem.help(format!(
                    "the model has the inputs that the study gives it: add `fixed = {{ {input} = 0 }}` to `[model]`"
                ));
            }
        }
        Err(loose) => {
            let (what, help) = match loose {
                Loose::Parameter => {
                    ("is free already: it is a parameter", "take `[[gap.switch]]` out")
                }
                Loose::Computed => (
                    "is set by an expression of `computed`",
                    "set free an input that the expression uses",
                ),
                Loose::Scenario => (
                    "is set by the scenarios, so that it has no one value at which it is absent",
                    "set free an input that all scenarios share",
                ),
                _ => (
                    "has no value that the study holds it at",
                    "give it one in `fixed` of `[model]`",
                ),
            };
            complaints.at("input").say(format!("`{input}` {what}")).help(help);
        }
    }
}

/// Checks the unit, the absent value and the prior of a switch.
fn fits(switch: &SwitchSection, held: &Held, complaints: &mut Complaints<'_>) {
    let unit = switch.unit.as_ref().unwrap_or(&held.input.unit);
    let Some(absent) = held.input.unit.convert(held.value, unit) else {
        complaints
            .at("unit")
            .say(format!("`{}` has another unit", switch.input))
            .expected(format!("a unit that converts to `{}`", held.input.unit))
            .found(format!("`{unit}`"));
        return;
    };
    if let Some(said) =
        switch.absent.filter(|x| (x - absent).abs() > 1e-9 * absent.abs().max(1e-300))
    {
        complaints
            .at("absent")
            .say(format!("the study holds `{}` at another value", switch.input))
            .expected(format!("{absent} {unit}").trim_end())
            .found(format!("{said} {unit}").trim_end())
            .help("change `fixed` of `[model]`, or leave `absent` out");
    }
    let (low, high) = switch.prior.support();
    if absent < low || absent > high {
        complaints
            .at("prior")
            .say("the prior leaves out the value at which nothing is added")
            .expected(format!("a prior that reaches {absent} {unit}").trim_end())
            .found(format!("[{low}, {high}]"));
    }
    within_range(switch, held, unit, complaints);
}

fn within_range(switch: &SwitchSection, held: &Held, unit: &Unit, complaints: &mut Complaints<'_>) {
    let (first, last) = held.input.range;
    let ends = [0.025, 0.975].map(|p| unit.convert(switch.prior.quantile(p), &held.input.unit));
    let [Some(low), Some(high)] = ends else { return };
    if low < first || high > last {
        let unit = &held.input.unit;
        complaints
            .at("prior")
            .say(format!("`{}` leaves the range in which the model answers", switch.input))
            .expected(format!("95 % of the prior from {first} to {last} {unit}").trim_end())
            .found(format!("[{low}, {high}]"));
    }
}

fn name(section: &Section<dyn Term, TermKeys>) -> &str {
    section.common.name(&section.built)
}

fn one_term(
    study: &Study,
    section: &Section<dyn Term, TermKeys>,
    twice: bool,
    complaints: &mut Complaints<'_>,
) {
    let name = name(section);
    let Some(model) = &study.model else { return };
    let Some(amend) = model.built.plugin.amend() else {
        complaints
            .at("")
            .say(format!("`{}` has no equations to which a term could be added", model.built.name))
            .expected("a model that the study writes as equations, with states");
        return;
    };
    let Some((layout, _)) =
        study.scenarios.first().and_then(|first| study.layouts.of_scenario(&first.name))
    else {
        return;
    };
    let context = study.context_of(&layout);
    let states = amend.states(&context);
    let names = || states.iter().map(|state| state.name.as_str());
    let taken = study.given.iter().any(|given| given.name == name) || names().any(|n| n == name);
    if taken || twice {
        complaints
            .at("name")
            .say(format!("there is something called `{name}` already"))
            .help(format!("give the coefficient a `name`, such as `{name}_2`"));
        return;
    }
    let Some(state) = states.iter().find(|state| state.name == section.common.state) else {
        let wanted = &section.common.state;
        let near = nearest(wanted, names());
        let problem = complaints.at("state").say(format!("the model has no state `{wanted}`"));
        problem.expected(one_of(names()));
        if let Some(near) = near {
            problem.help(format!("did you mean `{near}`?"));
        }
        return;
    };
    if let Some(wrong) = shape(study, section, state, &context) {
        complaints.at("").say(format!("the term `{name}`: {wrong}"));
    }
}

/// Returns the first error in the expressions of a term; `None` if they are correct.
fn shape(
    study: &Study,
    section: &Section<dyn Term, TermKeys>,
    state: &State,
    context: &Context<'_>,
) -> Option<String> {
    let amend = study.model.as_ref()?.built.plugin.amend()?;
    let time = lacuna::plugin::term::Time::of(context.layout);
    // The sizes do not matter to what the expressions are made of.
    let place = Place { state, name: name(section), time, size: &|_| Ok(1.0) };
    let summand = match section.built.plugin.summand(&place) {
        Ok(summand) => summand,
        Err(wrong) => return Some(wrong),
    };
    let indices = summand.indices.iter();
    let indices = indices.map(|i| Given { name: i.name.clone(), unit: Some(i.unit.clone()) });
    let given: Vec<Given> = context.given.iter().cloned().chain(indices).collect();
    let context = Context { given: &given, ..*context };
    let all = std::iter::once(&summand.shape).chain(summand.beside.iter().map(|(_, shape)| shape));
    all.filter_map(|shape| amend.unit(&context, shape, &summand.states).err())
        .map(|fault| fault.to_string())
        .next()
}

/// Checks that an alternative model has the study's response and that each of its inputs is set.
fn one_model(study: &Study, swap: &Swap, complaints: &mut Complaints<'_>) {
    let model = &*swap.section.built.plugin;
    for scenario in &study.scenarios {
        let Some((layout, _)) = study.layouts.of_scenario(&scenario.name) else { continue };
        let context = study.context_of(&layout);
        model.check(&context, complaints);
        let signature: Signature = model.signature(&context);
        if layout.unit.factor_to(&signature.layout.unit).is_none() {
            complaints
                .at("use")
                .say("the model's response has another dimension than the study's")
                .expected(format!("a unit that converts to `{}`", layout.unit))
                .found(format!("`{}`", signature.layout.unit));
            return;
        }
        let fixed = study.model.as_ref().map(|model| &model.common.fixed);
        let set = |name: &str| {
            study.unknowns.iter().any(|unknown| unknown.name == name)
                || scenario.value(name).is_some()
                || swap.keys.fixed.contains_key(name)
                || fixed.is_some_and(|fixed| fixed.contains_key(name))
        };
        for name in swap.keys.fixed.keys() {
            if !signature.inputs.iter().any(|input| &input.name == name) {
                let path = format!("fixed.{name}");
                complaints.at(&path).say(format!("the model has no input `{name}`"));
            }
        }
        let unset = signature.inputs.iter().find(|i| i.default.is_none() && !set(&i.name));
        if let Some(input) = unset {
            complaints
                .at("use")
                .say(format!("nothing sets the model's input `{}`", input.name))
                .help(format!("add it to `fixed = {{ {} = … }}`", input.name));
            return;
        }
    }
}

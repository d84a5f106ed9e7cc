//! Contract of terms.

use lacuna::data::Unit;
use lacuna::expression;
use lacuna::plugin::Term;
use lacuna::plugin::amend::State;
use lacuna::plugin::term::{Place, Summand, Time};

use crate::judge::{Check, judge, twice};

/// Tests a term against its contract, on a velocity in `m/s` over ten seconds.
///
/// - It has a description.
/// - Its shapes and rates are valid expressions, and reproducible.
/// - The names it introduces begin with the name of its coefficient, are distinct, and all are used.
/// - Its indices have starting values inside their priors.
pub fn term(name: &str, term: &dyn Term) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 4] = [
        ("describes itself", Box::new(|| describes_itself(term))),
        ("is written in expressions", Box::new(|| is_written_in_expressions(term))),
        ("names what it brings", Box::new(|| names_what_it_brings(term))),
        ("can be started", Box::new(|| can_be_started(term))),
    ];
    judge("term", name, &checks)
}

const NAME: &str = "coefficient";

fn summand(term: &dyn Term) -> Result<Summand, String> {
    let unit = |text: &str| Unit::parse(text).map_err(|error| error.to_string());
    let state = State {
        name: "v".into(),
        unit: unit("m/s")?,
        rate_unit: Some(unit("m/s2")?),
        rate: "-v".into(),
        uses: vec!["v".into()],
        start: "1".into(),
        ..State::default()
    };
    let seconds = unit("s")?;
    let time = Time { name: "t", unit: &seconds, duration: 10.0, step: 0.1 };
    term.summand(&Place { state: &state, name: NAME, time: Some(time), size: &|_| Ok(0.5) })
}

fn describes_itself(term: &dyn Term) -> Result<(), String> {
    let words = term.describe();
    for (what, text) in
        [("title", words.title), ("formula", words.formula), ("source", words.source)]
    {
        if text.trim().is_empty() {
            return Err(format!("its {what} is empty"));
        }
    }
    Ok(())
}

/// All expressions of a term.
fn texts(summand: &Summand) -> Vec<&String> {
    let beside = summand.beside.iter().map(|(_, shape)| shape);
    let states = summand.states.iter().flat_map(|state| [&state.rate, &state.start]);
    std::iter::once(&summand.shape).chain(beside).chain(states).chain(&summand.scale).collect()
}

fn is_written_in_expressions(term: &dyn Term) -> Result<(), String> {
    let summand = summand(term)?;
    for text in texts(&summand) {
        expression::check(text).map_err(|fault| format!("`{text}`: {fault}"))?;
    }
    if self::summand(term)? == summand { Ok(()) } else { Err("it changes".into()) }
}

fn names_what_it_brings(term: &dyn Term) -> Result<(), String> {
    let summand = summand(term)?;
    let indices = summand.indices.iter().map(|index| index.name.as_str());
    let names: Vec<&str> =
        indices.chain(summand.states.iter().map(|state| state.name.as_str())).collect();
    if let Some(name) = twice(names.iter().copied()) {
        return Err(format!("two things are called `{name}`"));
    }
    let used: Vec<String> = texts(&summand)
        .into_iter()
        .flat_map(|text| expression::names(text, &[]).unwrap_or_default())
        .collect();
    for name in names {
        if !name.starts_with(&format!("{NAME}_")) {
            return Err(format!("`{name}` does not begin with `{NAME}_`"));
        }
        if !used.iter().any(|other| other == name) {
            return Err(format!("`{name}` is not used"));
        }
    }
    Ok(())
}

fn can_be_started(term: &dyn Term) -> Result<(), String> {
    for index in &summand(term)?.indices {
        index.prior.check().map_err(|wrong| format!("the prior of `{}`: {wrong}", index.name))?;
        if index.starts.is_empty() {
            return Err(format!("`{}` has no starts", index.name));
        }
        let outside = index.starts.iter().find(|x| !index.prior.log_density(**x).is_finite());
        if let Some(start) = outside {
            return Err(format!("`{}` starts at {start}, outside its prior", index.name));
        }
    }
    Ok(())
}

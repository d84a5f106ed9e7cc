//! What the model misses, for scripts.

use serde_json::{Map, Value, json};

use crate::gap::account::{Account, Addition, HeldOut, Spot};
use crate::gap::added::Added;
use crate::gap::hold_out::Kind;
use crate::gap::name::Word;
use crate::gap::prove::{Closing, Comparison};
use crate::plugin::effect::On;
use crate::report::findings::GapFindings;

/// The key `gap`.
pub fn value(gap: &GapFindings) -> Value {
    let account = &gap.account;
    let effects: Vec<Value> =
        account.additions.iter().map(|a| effect(a, gap.added.as_ref())).collect();
    let regions = |k: usize| -> Vec<Value> {
        account.regions[k].iter().map(|spot| region(account, spot)).collect()
    };
    let is_replicates = |part: &&HeldOut| matches!(part.kind, Kind::Replicates | Kind::Blocks);
    let shown = gap.held_out();
    let first = shown.iter().find(is_replicates).or(shown.first());
    let others = shown.iter().filter(|part| Some(*part) != first);
    let mut value = json!({
        "verdict": account.verdict.word,
        "reasons": account.verdict.reasons,
        "noise_assumed": account.noise_assumed,
        "p": tests(account.p[0]),
        "p_after": tests(account.p[1]),
        "effects": effects,
        "class": class(account),
        "regions": regions(0),
        "regions_after": regions(1),
        "held_out": first.map(held_out),
        "parameters": parameters(account),
    });
    let others: Vec<Value> = others.map(held_out).collect();
    if !others.is_empty() {
        value["held_out_further"] = json!(others);
    }
    if !account.models.is_empty() {
        let each = account.models.iter().map(|model| {
            let value = json!({ "log_odds": model.log_odds, "error": model.error });
            (model.name.clone(), value)
        });
        value["models"] = each.collect::<Map<_, _>>().into();
    }
    if !account.needless.is_empty() {
        let each = account.needless.iter().map(|piece| {
            (piece.name.clone(), json!({ "log_odds": piece.log_odds, "error": piece.error }))
        });
        value["needless"] = each.collect::<Map<_, _>>().into();
    }
    value["insight"] = insight(account);
    if let Some(added) = &gap.added {
        value["study"] = json!(added.study);
        value["run"] = json!(added.run);
        if let Some([before, after]) = added.log_evidence {
            value["log_evidence"] = json!({ "before": before, "after": after });
        }
    }
    value
}

/// What else the search can tell.
fn insight(account: &Account) -> Value {
    let insight = &account.insight;
    let mut value = json!({ "foretold": insight.foretold, "against": insight.against });
    if let Some(map) = &insight.drift {
        let names = map.parameters.iter().map(|p| (p.name.clone(), json!(p.equality.p)));
        value["drift"] = json!({
            "reading": map.reading,
            "words": map.words,
            "p": map.all.p,
            "parameters": names.collect::<Map<_, _>>(),
        });
    }
    if let Some(separations) = &insight.separations {
        value["separations"] = json!(separations);
    }
    if !insight.places.is_empty() {
        let words: Vec<&str> = insight.places.iter().map(|p| p.words.as_str()).collect();
        value["places"] = json!(words);
    }
    if let Some(symbolic) = &insight.symbolic {
        value["symbolic"] = json!({ "form": symbolic.form, "explained": symbolic.explained });
    }
    if let Some(stopgap) = &insight.stopgap {
        value["stopgap"] = json!({ "explained": stopgap.explained, "length": stopgap.length });
    }
    value
}

fn tests(p: [f64; 3]) -> Value {
    json!({ "score": p[0], "scan": p[1], "energy": p[2] })
}

/// The types that cannot be told apart, where the verdict is a class.
fn class(account: &Account) -> Vec<&str> {
    if account.verdict.word != Word::Class {
        return Vec::new();
    }
    let mut all: Vec<&str> = Vec::new();
    for kind in account.additions.iter().flat_map(|addition| &addition.class) {
        if !all.contains(&kind.as_str()) {
            all.push(kind);
        }
    }
    all
}

fn effect(addition: &Addition, added: Option<&Added>) -> Value {
    let unknowns = addition.unknowns.iter().map(|unknown| {
        let short = unknown.name.rsplit('.').next().unwrap_or_default();
        let posterior =
            added.and_then(|added| added.unknowns.iter().find(|p| p.name == unknown.name));
        let value = if let Some(p) = posterior {
            json!({
                "mean": p.mean,
                "sd": p.sd,
                "q025": p.interval[0],
                "q975": p.interval[1],
                "unit": p.unit.to_string(),
            })
        } else {
            let moved = added.iter().flat_map(|added| &added.parameters);
            let shared = moved.filter(|_| addition.model).find(|p| p.name == unknown.name);
            let (mean, sd) = shared.map_or((unknown.value, unknown.sd), |p| (p.mean[1], p.sd[1]));
            json!({ "mean": mean, "sd": sd, "unit": unknown.unit.to_string() })
        };
        (short.to_owned(), value)
    });
    json!({
        "type": addition.kind,
        "name": addition.name,
        "sensors": labels(&addition.on),
        "on": addition.on,
        "parameters": unknowns.collect::<Map<_, _>>(),
        "probability": addition.probability,
        "class": addition.class,
    })
}

/// The labels of a place, whatever their axis.
fn labels(on: &On) -> Vec<&String> {
    on.values().flatten().collect()
}

fn region(account: &Account, spot: &Spot) -> Value {
    let curves = spot.curves.iter().map(|&s| &account.curves[s]);
    let mut sensors: Vec<&str> = Vec::new();
    for curve in curves.clone() {
        for (_, label) in &curve.labels {
            if !sensors.contains(&label.as_str()) {
                sensors.push(label);
            }
        }
    }
    let scenario = curves.clone().find_map(|curve| curve.scenario.as_deref());
    let mut value = json!({
        "sensors": sensors,
        "time": [spot.span.0, spot.span.1],
        "band": spot.band.map(|(low, high)| [low, high]),
        "p": spot.p,
    });
    if let Some(scenario) = scenario {
        value["scenario"] = json!(scenario);
    }
    value
}

fn held_out(part: &HeldOut) -> Value {
    let proof = &part.proof;
    let all = &proof.all;
    let conditions = proof.conditions.iter().filter_map(|condition| {
        let c = &condition.comparison;
        let value = json!({ "before": c.before, "after": c.after, "closed": c.closed, "lower": c.lower, "upper": c.upper });
        Some((condition.scenario.clone()?, value))
    });
    json!({
        "kind": part.kind,
        "names": part.names,
        "count": all.replicates,
        "before": all.before,
        "after": all.after,
        "closed": all.closed,
        "lower": all.lower,
        "upper": all.upper,
        "beyond_known_errors": beyond_known_errors(all),
        "shrank": proof.shrank,
        "rmse": { "before": proof.rmse[0], "after": proof.rmse[1] },
        "coverage": { "before": proof.coverage[0], "after": proof.coverage[1] },
        "accuracy": part.accuracy.map(|[before, after]| json!({ "before": before, "after": after })),
        "log_score": proof.log_score,
        "conditions": conditions.collect::<Map<_, _>>(),
    })
}

/// The gap that known errors could not explain.
fn beyond_known_errors(all: &Comparison) -> Value {
    let Closing { before, after, closed: [closed, lower, upper] } = all.beyond_known_errors;
    json!({ "before": before, "after": after, "closed": closed, "lower": lower, "upper": upper })
}

fn parameters(account: &Account) -> Value {
    let each = account.parameters.iter().map(|shift| {
        let side = |k: usize| json!({ "map": shift.value[k], "sd": shift.sd[k] });
        let value = json!({ "before": side(0), "after": side(1), "unit": shift.unit.to_string() });
        (shift.name.clone(), value)
    });
    each.collect::<Map<_, _>>().into()
}

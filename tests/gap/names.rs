//! Hidden effects of the library get their name, other physics gets none, and without a hidden effect nothing is found.

use generator::{Kind, SENSORS};
use lacuna_engine::gap::search::{MissingEffect, VerdictKind};

use super::cases::{Asked, LISTED, Plan, UNLISTED, asked, count};
use super::chain::ask;
use super::tally::{Rate, confusion};

/// One effect on one sensor, and in every fifth case on two.
fn single(i: u64, ratio: f64) -> Plan {
    let kinds = LISTED.len() as u64;
    let (kind, round) = (LISTED[(i % kinds) as usize].0, i / kinds);
    let first = ((i + round) % 4) as usize;
    let two = round % 5 == 4 && kind != Kind::Crosstalk;
    let sensors = if two { vec![first, (first + 2) % 4] } else { vec![first] };
    Plan::new(i + round, vec![(kind, sensors)], ratio)
}

fn alarm(asked: &Asked) -> bool {
    asked.answer.verdict.word != VerdictKind::None
}

/// Returns true if the verdict gives names.
fn names(asked: &Asked) -> bool {
    matches!(asked.answer.verdict.word, VerdictKind::Named | VerdictKind::Class)
}

fn kinds(asked: &Asked) -> Vec<String> {
    let mut all: Vec<String> =
        asked.answer.verdict.effects.iter().map(|e| e.kind.clone()).collect();
    all.sort();
    all.dedup();
    all
}

fn right(asked: &Asked) -> bool {
    let mut truths = asked.truths();
    truths.sort();
    truths.dedup();
    names(asked) && kinds(asked) == truths
}

/// Effects that these data often cannot distinguish: a lag of a tenth of a sample is similar to a delay, a low pass or
/// crosstalk from a sensor with a similar curve. The class of these effects is as good an answer as a name.
const ALIKE: [&str; 3] = ["delay", "low_pass", "crosstalk"];

/// Returns true if the type is right, or the class of indistinguishable effects contains it.
fn right_or_alike(asked: &Asked) -> bool {
    let alike = asked.truths().iter().all(|truth| ALIKE.contains(&truth.as_str()));
    right(asked) || alike && names(asked) && inside(asked)
}

fn inside(asked: &Asked) -> bool {
    let effects = &asked.answer.verdict.effects;
    let holds = |truth: &String| effects.iter().any(|e| e.class.contains(truth));
    alarm(asked) && asked.truths().iter().all(holds)
}

fn named(asked: &Asked) -> bool {
    asked.answer.verdict.word == VerdictKind::Named
}

/// True value of the library's parameter for hidden effects with one parameter; `None` for other effects.
fn number(asked: &Asked) -> Option<f64> {
    let hidden = &asked.case.hidden[0];
    match hidden.kind {
        Kind::Gain => Some(1.0 + hidden.size),
        Kind::Offset | Kind::Delay | Kind::LowPass => Some(hidden.size),
        _ => None,
    }
}

/// For a correctly named effect on the right sensors, true if its value is within two printed standard deviations of the truth:
/// a gain of two sensors is the inverse gain of all others where the parameters scale the response.
fn sized(asked: &Asked) -> Option<bool> {
    let number = number(asked).filter(|_| right(asked) && placed(asked))?;
    let held = |e: &MissingEffect| (e.values[0] - number).abs() <= 2.0 * e.sd[0];
    Some(asked.answer.verdict.effects.iter().all(held))
}

/// For an effect with a printed probability of at least 0.9, true if it is correct.
fn probable(asked: &Asked) -> Option<bool> {
    let first = asked.answer.verdict.effects.first()?;
    (first.probability >= 0.9).then(|| asked.truths().contains(&first.kind))
}

/// Returns true if each effect acts on the right sensors.
fn placed(asked: &Asked) -> bool {
    let hidden = &asked.case.hidden[0];
    let labels = |e: &MissingEffect| e.on.values().next().cloned().unwrap_or_default();
    let mut found: Vec<String> = asked.answer.verdict.effects.iter().flat_map(labels).collect();
    found.sort();
    let mut truth: Vec<String> = hidden.sensors.iter().map(|&s| SENSORS[s].to_owned()).collect();
    truth.sort();
    found == truth
}

fn said(asked: &Asked) -> (String, String) {
    let verdict = &asked.answer.verdict;
    let word = match verdict.word {
        VerdictKind::Named => kinds(asked).join(" + "),
        VerdictKind::Class => {
            let classes = verdict.effects.iter().map(|e| e.class.join(" or "));
            classes.collect::<Vec<_>>().join(" + ")
        }
        word => format!("{word:?}").to_lowercase(),
    };
    (asked.truths().join(" + "), word)
}

fn table(title: &str, all: &[Asked], rows: &[String]) {
    println!("\n### {title}\n\n| | cases | share | 95 % interval |\n| --- | --- | --- | --- |");
    for row in rows {
        println!("{row}");
    }
    let pairs: Vec<(String, String)> = all.iter().map(said).collect();
    println!("\n{}", confusion(&pairs));
}

fn misses(all: &[Asked], missed: impl Fn(&Asked) -> bool) {
    for asked in all.iter().filter(|a| missed(a)) {
        println!("missed: {}", asked.said());
    }
}

/// Rates for single effects of a size, from the kind of this number on; the rate of correct types has the lower bound
/// `demanded`.
fn singles(family: u64, ratio: f64, (first, cases): (u64, u64), demanded: f64) {
    let all = asked(family, (first..first + cases).map(|i| single(i, ratio)).collect());
    let sure: Vec<&Asked> = all.iter().filter(|a| named(a)).collect();
    let type_right = Rate::of(&all, right_or_alike);
    let in_class = Rate::of(&all, inside);
    let sure_right = Rate::of(&sure, |a| right(a));
    let held =
        |test: fn(&Asked) -> Option<bool>| -> Vec<bool> { all.iter().filter_map(test).collect() };
    let of_probable = Rate::of(&held(probable), |right| *right);
    let of_sized = Rate::of(&held(sized), |held| *held);
    let rows = [
        Rate::of(&all, alarm).row("gap found"),
        type_right.row("type right, or the class of delay, low pass and crosstalk"),
        Rate::of(&all, right).row("type right, alone or first of its class"),
        Rate::of(&all, |a| named(a) && right(a)).row("type named alone, rightly"),
        in_class.row("truth inside the class"),
        sure_right.row("of those named alone: right"),
        Rate::of(&all, placed).row("sensors right"),
        of_probable.row("of those with a probability of 0.9 or more: right"),
        of_sized.row("gain, offset, delay, time constant within two of their sd"),
    ];
    table(&format!("One effect, rms {ratio}"), &all, &rows);
    misses(&all, |a| !right(a) || !inside(a));
    type_right.assert_above("type right", demanded);
    in_class.assert_above("inside the class", 0.95);
    sure_right.assert_above("right of those named alone", 0.98);
    of_probable.assert_above("right of those with a probability of 0.9", 0.90);
    of_sized.assert_above("numbers within two standard deviations", 0.9545);
}

/// Requirement: the type is right in 90 of 100 cases at half the noise of one replicate.
#[test]
fn half_as_large_as_the_noise() {
    singles(1, 0.5, (0, count(126, 7)), 0.90);
}

/// Requirement: the type is right in 95 of 100 cases at the noise of one replicate. A short run has the other half of the
/// kinds.
#[test]
fn as_large_as_the_noise() {
    let (kinds, cases) = (LISTED.len() as u64, count(126, 7));
    let first = if cases < kinds { kinds / 2 } else { 0 };
    singles(2, 1.0, (first, cases), 0.95);
}

/// Requirement: at most five false alarms in a hundred. The levels of the tests are three and two per cent.
#[test]
fn without_a_gap_there_is_no_alarm() {
    let all = asked(3, (0..count(200, 10)).map(|i| Plan::new(i, Vec::new(), 0.0)).collect());
    let alarms = Rate::of(&all, alarm);
    let regions = Rate::of(&all, |a| !a.answer.regions.is_empty());
    let below = |k: usize, level: f64| Rate::of(&all, |a| a.answer.p[k] <= level);
    let rows = [
        alarms.row("alarms"),
        regions.row("a region with p ≤ 0.05"),
        below(0, 0.05).row("largest score with p ≤ 0.05"),
        below(1, 0.05).row("scan with p ≤ 0.05"),
        below(2, 0.05).row("energy with p ≤ 0.05"),
    ];
    table("Nothing hidden", &all, &rows);
    misses(&all, alarm);
    alarms.assert_below("alarms", 0.05);
    regions.assert_below("regions", 0.05);
}

/// Requirement: the verdict that unlisted physics is missing in 80 of 100 cases, and a single name in at most 10.
#[test]
fn what_is_not_listed_gets_no_name() {
    let plan = |i: u64| {
        let kind = UNLISTED[(i % 5) as usize];
        let single = matches!(kind, Kind::Burst | Kind::Rectified);
        let sensors = if single { vec![((i / 5 + i) % 4) as usize] } else { (0..4).collect() };
        Plan::new(i, vec![(kind, sensors)], 1.0)
    };
    let all = asked(4, (0..count(40, 2)).map(plan).collect());
    let unlisted = Rate::of(&all, |a| a.answer.verdict.word == VerdictKind::Unlisted);
    let false_names = Rate::of(&all, named);
    let rows = [unlisted.row("unlisted"), false_names.row("named alone, falsely")];
    table("Of no library, rms 1", &all, &rows);
    misses(&all, |a| a.answer.verdict.word != VerdictKind::Unlisted);
    unlisted.assert_above("unlisted", 0.80);
    false_names.assert_below("named alone", 0.10);
}

/// Requirement: both types right in 85 of 100 cases.
#[test]
fn two_effects_are_both_named() {
    let plan = |i: u64| {
        let n = LISTED.len() as u64;
        let (first, second) = (i % n, (i + 1 + (3 * i + i / n) % (n - 1)) % n);
        let (a, b) = ((i % 4) as usize, ((i + 1 + i / 4 % 3) % 4) as usize);
        let kind = |k: u64| LISTED[k as usize].0;
        Plan::new(i, vec![(kind(first), vec![a]), (kind(second), vec![b])], 1.0)
    };
    let all = asked(5, (0..count(30, 2)).map(plan).collect());
    let both = Rate::of(&all, |a| {
        kinds(a) == {
            let mut truths = a.truths();
            truths.sort();
            truths.dedup();
            truths
        }
    });
    let rows = [
        both.row("both types right"),
        Rate::of(&all, right).row("and the verdict names them or their classes"),
        Rate::of(&all, inside).row("both inside their classes"),
    ];
    table("Two effects, rms 1 each", &all, &rows);
    misses(&all, |a| !right(a));
    both.assert_above("both right", 0.85);
}

/// Beside an echo on three sensors, the fourth is rectified, which no candidate has: a gain stands for that in part, and the
/// sum has no name. The echo alone is certain and keeps it; the gain is left to the remainder. The seed is one with such a
/// sum.
#[test]
fn a_certain_part_keeps_its_name_beside_what_has_none() {
    let hidden = [(Kind::Echo, vec![0, 1, 3]), (Kind::Rectified, vec![2])];
    let answer = ask(&generator::case(901, &hidden, 2.0, 8), 8, 901).verdict;
    assert_eq!(answer.word, VerdictKind::Approximate, "{answer:?}");
    let [echo] = &answer.effects[..] else { panic!("{:?}", answer.effects) };
    assert!(echo.kind == "echo" && echo.certain, "{echo:?}");
    assert_eq!(echo.on["sensor"], [0, 1, 3].map(|s| SENSORS[s]), "{echo:?}");
    let is_left_out = |reason: &String| reason.starts_with("`gain` would explain more");
    assert!(answer.reasons.iter().any(is_left_out), "{:?}", answer.reasons);
}

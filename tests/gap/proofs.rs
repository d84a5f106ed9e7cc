//! The proof on held-out data: the gap that closes, its interval, and names that fail.

use std::fs;

use generator::chain::CONDITIONS;
use generator::noise::{Source, replicate};
use generator::{Case, Chain, Hidden, Kind, REFERENCE, noise_sd, sampled};
use lacuna::diagnose::coverage::binomial;
use lacuna::run::Silent;
use lacuna_engine::gap::experiment::Experiment;
use lacuna_engine::gap::experiment::hold_out::HeldOutKind;
use lacuna_engine::gap::noise::{Noise, ResponseTangents};
use lacuna_engine::gap::prove::{Proof, freedoms, prove};
use lacuna_engine::gap::result::names::{NameProof, ProofKind};
use lacuna_engine::gap::result::{GapResult, HeldOut};
use lacuna_run::RunDirectory;
use rayon::prelude::*;

use super::cases::{Asked, LISTED, Plan, asked, count};
use super::chain::{self, emulator, layouts, parameters};
use super::inside::loaded;
use super::tally::Rate;

/// Requirement: the interval of the closed fraction is above zero in 90 of 100 cases, at 0.8 times the noise of one
/// replicate, with eight replicates for the search and four held out.
#[test]
fn the_gap_shrinks_on_replicates_held_out() {
    let plan = |i: u64| {
        let kind = LISTED[(i % 14) as usize].0;
        let kinds = vec![(kind, vec![((i + i / 14) % 4) as usize])];
        Plan { replicates: 8, held_out: 4, ..Plan::new(i, kinds, 0.8) }
    };
    let all = asked(7, (0..count(56, 4)).map(plan).collect());
    let lower = |a: &Asked| a.answer.proof.as_ref().map_or(f64::NAN, |p| p.all.lower);
    let above = Rate::of(&all, |a| lower(a) > 0.0);
    let shrank = Rate::of(&all, |a| a.answer.proof.as_ref().is_some_and(|p| p.shrank));
    println!("\n### The gap on replicates held out, rms 0.8\n");
    println!("{}", above.row("lower bound above zero"));
    println!("{}", shrank.row("and no condition worse"));
    for a in all.iter().filter(|a| lower(a).is_nan() || lower(a) <= 0.0) {
        println!("missed: {} {:?}", a.said(), a.answer.proof);
    }
    above.assert_above("above zero", 0.90);
}

/// Replicates of the noise estimate, and of the proof.
const SEEN: usize = 8;
const KEPT: usize = 4;

/// The proof for data in which an effect is hidden that changes its sensor by `ratio` times the noise, if the model is
/// true without it and `step` times the hidden change is added: the share closed is `1 - (1 - step)^2` whatever the
/// noise.
fn proven(seed: u64, ratio: f64, step: f64) -> Proof {
    let mut random = Source::new(seed);
    let kind = LISTED[(seed % 14) as usize].0;
    let sd = noise_sd();
    let sensor = vec![(seed / 14 % 4) as usize];
    let hidden = [Hidden::sized(kind, &sensor, REFERENCE, &sd, ratio, &mut random)];
    let (layouts, parameters, (emulator, _)) = (layouts(), parameters(), emulator());
    let (mut before, mut after, mut replicates) = (Vec::new(), Vec::new(), Vec::new());
    for condition in 0..CONDITIONS {
        let plain = sampled(&Chain::plain(REFERENCE).curves(condition));
        let true_curves = sampled(&generator::hidden::curves(&hidden, REFERENCE, condition));
        for (x, y) in plain.iter().flatten().zip(true_curves.iter().flatten()) {
            before.push(*x);
            after.push(x + step * (y - x));
        }
        let one = |_| replicate(&true_curves, &sd, &mut random);
        replicates.push((0..SEEN + KEPT).map(one).collect::<Vec<_>>());
    }
    let case = Case { truth: REFERENCE, hidden: hidden.to_vec(), replicates };
    let data = chain::observations(&case, 0..SEEN);
    let experiment = Experiment::new(&layouts, &parameters, &**emulator, &data);
    let noise = Noise::of(&experiment, &ResponseTangents::fixed(&after), None);
    let held_out = chain::observations(&case, SEEN..SEEN + KEPT);
    let held_out = Experiment::new(&layouts, &parameters, &**emulator, &held_out);
    prove(&held_out, &noise, &freedoms(&experiment), &before, &after).unwrap()
}

/// A row of the table of coverage: how many intervals hold the truth, with the band of 99 % of such counts.
fn row(name: &str, inside: usize, of: usize) {
    let [low, high] = binomial::band(of, 0.95, 0.005);
    println!("| {name} | {inside} of {of} | {low} to {high} |");
}

/// The interval of the share closed holds the truth in 95 % of cases at least, for gaps of 0.5 to 1.5 times the noise on
/// one sensor of four: the count is not below the band of 99 % of such counts. `shrank` is false where nothing closes
/// (the effect is twice too large), in 97.5 % of cases at least.
#[test]
fn the_interval_of_the_share_closed_holds_the_truth() {
    chain::prepare();
    let of = count(2000, 80);
    println!(
        "\n### The interval of the share closed\n\n| case | inside | 99 % band |\n|---|---|---|"
    );
    let each = |seed: u64, ratio: f64, step: f64| -> Vec<Proof> {
        (0..of).into_par_iter().map(|i| proven(seed + i, ratio, step)).collect()
    };
    let mut failures = Vec::new();
    let cases = [(0.5, 0.7), (0.8, 0.5), (0.8, 1.0), (1.5, 0.7)];
    for (k, (ratio, step)) in (1..).zip(cases) {
        let truth = 1.0 - (1.0 - step) * (1.0 - step);
        let all = each(1_000_000 * k, ratio, step);
        let holds = |p: &&Proof| p.all.lower <= truth && truth <= p.all.upper;
        let inside = all.iter().filter(holds).count();
        let name = format!("rms {ratio}, closed {:.0} %", 100.0 * truth);
        row(&name, inside, all.len());
        if inside < binomial::band(all.len(), 0.95, 0.005)[0] {
            failures.push(name);
        }
    }
    let false_alarms = each(9_000_000, 0.8, 2.0).iter().filter(|p| p.shrank).count();
    println!("| shrank although nothing closes, rms 0.8 | {false_alarms} of {of} | |");
    let most = binomial::band(of as usize, 0.025, 0.005)[1];
    assert!(false_alarms <= most, "{false_alarms} above {most} of {of}");
    assert!(failures.is_empty(), "{failures:?}");
}

/// The result of a search among some candidates, and the proof of its names, if it gives any.
fn named(case: &Case, seed: u64, candidates: &[&str]) -> (GapResult, Option<NameProof>) {
    let (result, proof) = chain::searched(case, SEEN, seed, candidates);
    let kind = HeldOutKind::Replicates;
    let part = HeldOut { kind, names: Vec::new(), proof, accuracy: None };
    let proof = NameProof::of(&result, std::slice::from_ref(&part));
    (GapResult { held_out: vec![part], ..result }, proof)
}

/// Damping acts on all sensors and in both conditions. Named `damping` it passes the proof. Where only wrong candidates
/// may be named, none is, or its proof fails.
#[test]
fn a_wrong_name_fails_where_the_right_one_transfers() {
    chain::prepare();
    let case = generator::case(31, &[(Kind::Damping, vec![0, 1, 2, 3])], 1.5, SEEN + KEPT);
    let candidates = ["damping", "echo", "low_pass", "saturation", "drift", "resonance"];
    let all: Vec<(GapResult, Option<NameProof>)> =
        candidates.par_iter().map(|name| named(&case, 31, &[name])).collect();
    for (name, (result, proof)) in candidates.iter().zip(&all) {
        let closed = result.held_out[0].proof.all.lower;
        println!(
            "{name}: {:?} {} effects, closed from {closed:.2}; {proof:?}",
            result.verdict.word,
            result.additions.len()
        );
    }
    let (_, right) = &all[0];
    let right = right.as_ref().unwrap();
    assert_eq!((right.kind, right.passed), (ProofKind::Transfer, true), "{right:?}");
    for (name, (result, proof)) in candidates.iter().zip(&all).skip(1) {
        let Some(proof) = proof else { continue };
        assert!(!proof.passed, "{name} {:?} {proof:?}", result.verdict);
    }
}

const SHORT: &str = r#"
[study]
title = "a short record"
seed = 3

[[parameter]]
name = "level0"
unit = "m"
prior = { normal = [0.0, 1.0] }

[response]
name = "level"
unit = "m"
axes = { t = { first = 1.0, last = 6.0, count = 6, unit = "s" } }

[model]
use = "equations"
state = { y = { start = "level0", unit = "m" } }
rate = { y = "0 {m/s}" }
observe = "y"

[measurements]
use = "csv"
path = "line.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "no_u_turn"
warm_up = 40
steps = 60

[gap]
simulations = 99
candidates = ["drift"]
terms = false
"#;

/// One condition and one curve that is too short for blocks: only replicates can be left out, and the proof says so.
#[test]
fn replicates_alone_are_reproducible() {
    let mut random = Source::new(8);
    let data = generator::line::replicates([0.3, 0.4], 0.3, 12, &mut random);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("line.csv"), generator::line::table(&data)).unwrap();
    let study = loaded(&folder, SHORT);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let gap = findings.gap.as_ref().unwrap();
    let proof = gap.proof().unwrap();
    assert_eq!((proof.kind, proof.passed), (ProofKind::Reproducible, true), "{proof:?}");
    let text = lacuna_engine::report::gap_text(&findings);
    let words =
        "replicates share the mean curve, so this does not show that the effect holds elsewhere";
    assert!(text.contains("Reproducible: ") && text.contains(words), "{text}");
    assert!(!text.contains("shrank"), "{text}");
    let summary = crate::quick::described::summary_of(&findings);
    assert_eq!(summary["gap"]["proof"]["kind"], "reproducible");
    assert_eq!(summary["gap"]["proof"]["passed"], true);
}

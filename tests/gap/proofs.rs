//! The added effect shrinks the gap on held-out replicates.

use super::cases::{Asked, LISTED, Plan, asked, count};
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

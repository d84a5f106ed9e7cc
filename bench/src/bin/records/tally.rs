//! Counts of answers with the 95 % intervals of Clopper and Pearson (Biometrika 26 (1934) 404).

use std::fmt::Write as _;

use lacuna_engine::gap::search::VerdictKind;

use crate::case::{Answer, Judgement};

/// A case as the tables count it.
struct Counted {
    exact: bool,
    hidden: bool,
    stated: bool,
    judged: Judgement,
    silent: bool,
    seconds: f64,
}

/// All cases so far.
#[derive(Default)]
pub struct Tally(Vec<Counted>);

impl Tally {
    /// Adds a case.
    pub fn add(&mut self, answer: &Answer) {
        let missing = &answer.record.missing;
        let none = matches!(answer.verdict, VerdictKind::None | VerdictKind::NotVisible);
        self.0.push(Counted {
            exact: !missing.exact.is_empty(),
            hidden: !missing.laws.is_empty(),
            stated: answer.stated,
            judged: answer.judged(),
            silent: none && !answer.noise_said,
            seconds: answer.seconds[0],
        });
    }

    /// The table of rates.
    pub fn table(&self) -> String {
        let mut text =
            "| | noise assumed | | noise stated | |\n| --- | --- | --- | --- | --- |\n".to_owned();
        let is = |judged: Judgement| move |case: &Counted| case.judged == judged;
        let false_name = |case: &Counted| case.judged == Judgement::False;
        let rows: [(&str, fn(&Counted) -> bool, &dyn Fn(&Counted) -> bool); 12] = [
            ("form of a term: right names", |c| c.exact, &is(Judgement::Right)),
            ("part of a sum named", |c| c.exact, &is(Judgement::Part)),
            ("a near form named", |c| c.exact, &is(Judgement::Near)),
            ("found without a name", |c| c.exact, &is(Judgement::Unnamed)),
            ("false name", |c| c.exact, &false_name),
            ("not found", |c| c.exact, &is(Judgement::Missed)),
            (
                "no form of a term: no name, or an approximate one",
                |c| c.hidden && !c.exact,
                &is(Judgement::Right),
            ),
            ("a near form named", |c| c.hidden && !c.exact, &is(Judgement::Near)),
            ("false name", |c| c.hidden && !c.exact, &false_name),
            ("not found", |c| c.hidden && !c.exact, &is(Judgement::Missed)),
            ("nothing hidden: nothing said", |c| !c.hidden, &is(Judgement::Right)),
            ("not found, without a word about the noise", |c| c.hidden, &|c: &Counted| c.silent),
        ];
        for (what, among, holds) in rows {
            let cell = |stated: bool| {
                let own: Vec<&Counted> =
                    self.0.iter().filter(|c| c.stated == stated && among(c)).collect();
                rate(own.iter().filter(|c| holds(c)).count() as u64, own.len() as u64)
            };
            let _ = writeln!(text, "| {what} | {} | {} |", cell(false), cell(true));
        }
        let mut seconds: Vec<f64> = self.0.iter().map(|c| c.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let at = |q: f64| seconds.get((q * seconds.len() as f64) as usize).copied();
        let last = seconds.last().copied();
        let shown = |value: Option<f64>| value.map_or("-".to_owned(), |s| format!("{s:.1} s"));
        let _ = write!(
            text,
            "\ntime: median {}, 90 % below {}, longest {}",
            shown(at(0.5)),
            shown(at(0.9)),
            shown(last)
        );
        text
    }
}

/// Events among trials in two cells, with the interval.
fn rate(events: u64, trials: u64) -> String {
    if trials == 0 {
        return "0/0 | -".to_owned();
    }
    let [low, high] = interval(events, trials).map(|p| 100.0 * p);
    format!(
        "{events}/{trials} = {:.0} % | {low:.0} to {high:.0} %",
        100.0 * events as f64 / trials as f64
    )
}

fn interval(events: u64, trials: u64) -> [f64; 2] {
    let low =
        if events == 0 { 0.0 } else { bisected(|p| 1.0 - at_most(events - 1, trials, p) < 0.025) };
    let high =
        if events == trials { 1.0 } else { bisected(|p| at_most(events, trials, p) > 0.025) };
    [low, high]
}

/// Probability of at most this many events.
fn at_most(events: u64, trials: u64, p: f64) -> f64 {
    let mut term = (trials as f64 * (-p).ln_1p()).exp();
    let mut sum = term;
    for k in 0..events {
        term *= (trials - k) as f64 / (k + 1) as f64 * p / (1.0 - p);
        sum += term;
    }
    sum
}

/// The largest number between zero and one for which a monotone condition holds.
fn bisected(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

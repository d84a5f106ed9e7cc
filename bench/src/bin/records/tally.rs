//! Counts of answers with the 95 % intervals of Clopper and Pearson (Biometrika 26 (1934) 404).

use std::fmt::Write as _;

use lacuna::diagnose::coverage::binomial::interval;
use lacuna_engine::gap::search::VerdictKind;

use crate::case::{Answer, Judgement, Proven};

/// Sort of a case.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hidden {
    Nothing,
    /// Physics of a term's form, or a sum of two.
    Exact,
    /// Physics of no term's form.
    Other,
}

/// A case as the tables count it.
struct Counted {
    hidden: Hidden,
    stated: bool,
    judged: Judgement,
    silent: bool,
    proven: Option<Proven>,
    seconds: f64,
}

/// A row of the table: its words, the cases that it counts, and those that it counts as events.
type Row<'a> = (&'a str, fn(&Counted) -> bool, &'a dyn Fn(&Counted) -> bool);

/// All cases so far.
#[derive(Default)]
pub struct Tally(Vec<Counted>);

impl Tally {
    /// Adds a case.
    pub fn add(&mut self, answer: &Answer) {
        let missing = &answer.record.missing;
        let none = matches!(answer.verdict, VerdictKind::None | VerdictKind::NotVisible);
        self.0.push(Counted {
            hidden: match (missing.laws.is_empty(), missing.exact.is_empty()) {
                (true, _) => Hidden::Nothing,
                (false, false) => Hidden::Exact,
                (false, true) => Hidden::Other,
            },
            stated: answer.stated,
            judged: answer.judged(),
            silent: none && !answer.noise_said,
            proven: answer.proven,
            seconds: answer.seconds[0],
        });
    }

    /// The table of rates.
    pub fn table(&self) -> String {
        let mut text =
            "| | noise assumed | | noise stated | |\n| --- | --- | --- | --- | --- |\n".to_owned();
        let is = |judged: Judgement| move |case: &Counted| case.judged == judged;
        let passed = |case: &Counted| case.proven.is_some_and(|proof| proof != Proven::Failed);
        let is_right: fn(&Counted) -> bool = |case| {
            case.proven.is_some() && matches!(case.judged, Judgement::Right | Judgement::Part)
        };
        let false_name = |case: &Counted| case.judged == Judgement::False;
        let rows: [Row<'_>; 16] = [
            ("form of a term: right names", |c| c.hidden == Hidden::Exact, &is(Judgement::Right)),
            ("part of a sum named", |c| c.hidden == Hidden::Exact, &is(Judgement::Part)),
            ("a near form named", |c| c.hidden == Hidden::Exact, &is(Judgement::Near)),
            ("found without a name", |c| c.hidden == Hidden::Exact, &is(Judgement::Unnamed)),
            ("false name", |c| c.hidden == Hidden::Exact, &false_name),
            ("not found", |c| c.hidden == Hidden::Exact, &is(Judgement::Missed)),
            (
                "no form of a term: no name, or an approximate one",
                |c| c.hidden == Hidden::Other,
                &is(Judgement::Right),
            ),
            ("a near form named", |c| c.hidden == Hidden::Other, &is(Judgement::Near)),
            ("false name", |c| c.hidden == Hidden::Other, &false_name),
            ("not found", |c| c.hidden == Hidden::Other, &is(Judgement::Missed)),
            (
                "nothing hidden: nothing said",
                |c| c.hidden == Hidden::Nothing,
                &is(Judgement::Right),
            ),
            (
                "not found, without a word about the noise",
                |c| c.hidden != Hidden::Nothing,
                &|c: &Counted| c.silent,
            ),
            ("right or a part of a sum, named: proof passed", is_right, &passed),
            (
                "a near form named: proof passed",
                |c| c.judged == Judgement::Near && c.proven.is_some(),
                &passed,
            ),
            (
                "false name: proof passed",
                |c| c.judged == Judgement::False && c.proven.is_some(),
                &passed,
            ),
            (
                "names: passed only because each part favours them",
                |c| c.proven.is_some(),
                &|c: &Counted| c.proven == Some(Proven::ByEachPart),
            ),
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
    let share = interval(events as f64, trials as f64, 0.95);
    let [low, high] = share.map(|p| 100.0 * p);
    format!(
        "{events}/{trials} = {:.0} % | {low:.0} to {high:.0} %",
        100.0 * events as f64 / trials as f64
    )
}

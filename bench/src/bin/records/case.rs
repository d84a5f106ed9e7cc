//! One case: a record, its study, and what the workflow says about it.

use std::error::Error;
use std::fs;
use std::time::Instant;

use generator::single::{Record, record};
use lacuna::run::Silent;
use lacuna_bench::clock::timed;
use lacuna_engine::gap::result::names::{NameProof, RivalComparison};
use lacuna_engine::gap::result::{GapResult, StepResult};
use lacuna_engine::gap::search::{MissingEffect, PROVEN, VerdictKind};
use lacuna_engine::study::resolve::load_text;
use lacuna_run::RunDirectory;

use crate::studies::{study, table};

/// The names of the columns.
pub const HEADER: &str = "case\tsystem\thidden\tform\tinstrument\tstated\tvalues\tratio\tjudged\tverdict\teffects\tprobability\tclosed\tinterval\tnoise_said\tproof\tseconds\tprocessor\ttraits";

/// The judgement of a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judgement {
    /// The right names; no form named where there is none; nothing found where nothing is hidden.
    Right,
    /// Part of a sum named.
    Part,
    /// A nearly right form named as if it were exact.
    Near,
    /// A false name.
    False,
    /// Without a name though there is one.
    Unnamed,
    /// Nothing said.
    Missed,
}

/// Outcome of the proof on left-out data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Proven {
    /// By the standard error of the parts together.
    Passed,
    /// Some name only because every part favours it.
    ByEachPart,
    /// Not proven.
    Failed,
}

impl Proven {
    fn of(proof: &NameProof) -> Self {
        let by_error = |rival: &RivalComparison| rival.score.is_better(PROVEN);
        match (proof.passed, proof.rivals.iter().all(by_error)) {
            (true, true) => Self::Passed,
            (true, false) => Self::ByEachPart,
            (false, _) => Self::Failed,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::ByEachPart => "passed by each part",
            Self::Failed => "failed",
        }
    }
}

/// A case with its answer.
pub struct Answer {
    index: usize,
    pub record: Record,
    pub stated: bool,
    pub verdict: VerdictKind,
    pub reasons: Vec<String>,
    /// The candidates of largest weight of each step, with the logarithm of their weight.
    pub leaders: Vec<String>,
    effects: Vec<MissingEffect>,
    closed: Option<(f64, [f64; 2])>,
    /// True when the verdict says what was taken for noise.
    pub noise_said: bool,
    /// Outcome of the proof on left-out data; `None` without names.
    pub proven: Option<Proven>,
    /// Wall time and processor time.
    pub seconds: [f64; 2],
}

/// Asks the workflow, which does not see what is hidden.
pub fn ask(seed: u64, index: usize) -> Result<Answer, Box<dyn Error>> {
    let record = record(seed, index);
    // Whole rounds of the systems alternate, so that each missing physics has both.
    let stated = (index + index / generator::single::kinds()).is_multiple_of(2);
    let step = record.times[1] - record.times[0];
    let said = record.instrument.stated(record.sd, step);
    let folder =
        std::env::temp_dir().join(format!("lacuna-records-{}-{seed}-{index}", std::process::id()));
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("data.csv"), table(&record))?;
    let text = study(&record, stated.then_some(&said));
    let checked = load_text(&folder.join("study.toml"), &text, &[]);
    let complaints = checked.complaints();
    let loaded = checked.study.ok_or_else(|| format!("{complaints}\n{text}"))?;
    let mut run = RunDirectory::open(&folder.join("run"))?;
    let begun = Instant::now();
    let (findings, processor) =
        timed(|| lacuna_engine::pipeline::find_gap(&loaded, &mut run, &Silent))?;
    let (findings, seconds) = (findings?, begun.elapsed().as_secs_f64());
    fs::remove_dir_all(&folder)?;
    let gap = findings.gap.ok_or("the study has no gap")?;
    let proof = gap.proof().as_ref().map(Proven::of);
    Ok(Answer::of(index, (record, stated), &gap.result, proof, [seconds, processor]))
}

impl Answer {
    fn of(
        index: usize,
        (record, stated): (Record, bool),
        result: &GapResult,
        proven: Option<Proven>,
        seconds: [f64; 2],
    ) -> Self {
        let verdict = &result.verdict;
        let proof = result.held_out.first().map(|held| &held.proof.all);
        Self {
            index,
            record,
            stated,
            verdict: verdict.word,
            reasons: verdict.reasons.clone(),
            leaders: result.path.iter().map(leaders).collect(),
            effects: verdict.effects.clone(),
            closed: proof.map(|all| (all.closed, [all.lower, all.upper])),
            noise_said: verdict.reasons.iter().any(|reason| reason.contains("taken for noise")),
            proven,
            seconds,
        }
    }

    /// The judgement: a class counts by its first type, and an approximate name of a near form is right, for that is
    /// what it says.
    pub fn judged(&self) -> Judgement {
        let missing = &self.record.missing;
        let said: Vec<&str> = self.effects.iter().map(|effect| effect.class[0].as_str()).collect();
        let names = matches!(
            self.verdict,
            VerdictKind::Named | VerdictKind::Class | VerdictKind::Approximate
        );
        let has_gap = !missing.laws.is_empty();
        match (has_gap, names) {
            (false, false) if self.verdict == VerdictKind::Unlisted => Judgement::False,
            (false, names) => {
                if names {
                    Judgement::False
                } else {
                    Judgement::Right
                }
            }
            (true, false) if self.verdict != VerdictKind::Unlisted => Judgement::Missed,
            (true, false) if missing.exact.is_empty() => Judgement::Right,
            (true, false) => Judgement::Unnamed,
            (true, true) => self.judged_names(&said),
        }
    }

    fn judged_names(&self, said: &[&str]) -> Judgement {
        let missing = &self.record.missing;
        let all_in = |list: &[&str]| said.iter().all(|kind| list.contains(kind));
        if !missing.exact.is_empty() && all_in(missing.exact) {
            let whole = missing.exact.iter().all(|kind| said.contains(kind));
            return if whole { Judgement::Right } else { Judgement::Part };
        }
        match (all_in(missing.near), self.verdict) {
            (true, VerdictKind::Named) => Judgement::Near,
            (true, _) if missing.exact.is_empty() => Judgement::Right,
            (true, _) => Judgement::Near,
            (false, _) => Judgement::False,
        }
    }

    /// The case as values that are separated by tabs.
    pub fn line(&self) -> String {
        let Record { system, missing, instrument, values, ratio, .. } = &self.record;
        let form = match (missing.laws.is_empty(), missing.exact.is_empty()) {
            (true, _) => "nothing",
            (_, true) => "outside",
            (_, false) => "inside",
        };
        let names: Vec<String> = self.effects.iter().map(|e| e.class.join("/")).collect();
        let probabilities: Vec<String> =
            self.effects.iter().map(|e| format!("{:.2}", e.probability)).collect();
        let closed = self.closed.map_or("-\t-".to_owned(), |(closed, [low, high])| {
            format!("{:.0} %\t{:.0} to {:.0} %", 100.0 * closed, 100.0 * low, 100.0 * high)
        });
        format!(
            "{}\t{:?}\t{}\t{form}\t{}\t{}\t{}\t{ratio:.1}\t{:?}\t{:?}\t{}\t{}\t{closed}\t{}\t{}\t{:.1}\t{:.1}\t{}",
            self.index,
            system.kind,
            missing.name,
            instrument.name(),
            if self.stated { "stated" } else { "assumed" },
            values.len(),
            self.judged(),
            self.verdict,
            names.join(" + "),
            probabilities.join(" "),
            self.noise_said,
            self.proven.map_or("-", Proven::word),
            self.seconds[0],
            self.seconds[1],
            self.effects.iter().map(|e| self.traits(e)).collect::<Vec<_>>().join(" & ")
        )
    }

    /// Marks whether the class of an effect has the type that is hidden, or one near to it that is named as such, and the
    /// quantities from which its probability follows.
    fn traits(&self, effect: &MissingEffect) -> String {
        let missing = &self.record.missing;
        let holds = |types: &[&str]| effect.class.iter().any(|kind| types.contains(&&**kind));
        let near = self.verdict != VerdictKind::Named && holds(missing.near);
        let right = u8::from(holds(missing.exact) || near);
        let t = effect.traits.unwrap_or_default();
        let each = [t.log_odds, t.local, t.transfer, t.closed, t.inexact];
        let each: Vec<String> = each.iter().map(|x| format!("{x:.3}")).collect();
        format!("{right} {}", each.join(" "))
    }
}

/// The candidates of largest weight of a step.
fn leaders(step: &StepResult) -> String {
    let each = step.leaders.iter().take(8).map(|l| format!("{} {:.1}", l.kind, l.log_weight));
    each.collect::<Vec<_>>().join(", ")
}

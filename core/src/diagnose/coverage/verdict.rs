//! Whether the intervals hold the truth as often as they say, in words.

use serde::{Deserialize, Serialize};

use super::{Rate, Row, Side};

/// The probability with which chance alone leaves a band.
pub const ALPHA: f64 = 0.01;

/// The share of failed calibrations above which the others say little.
const FAILED: f64 = 0.05;

/// The judgement on a study's intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// In one word.
    pub word: Word,
    /// In a sentence.
    pub text: String,
}

/// The judgement in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// All shares are inside their bands.
    Nominal,
    /// A share is outside its band, but not of the one that allows for the number of shares; or too many calibrations failed.
    Doubtful,
    /// The intervals hold the truth less often than they say.
    TooNarrow,
    /// The intervals hold the truth more often than they say.
    TooWide,
    /// The shares are right and the ranks are not uniform.
    NotUniform,
    /// There was nothing to count.
    Nothing,
}

impl Verdict {
    /// Judges each unknown whose truths are of its prior, at each level, and all together.
    ///
    /// A share outside its own 99 % band raises a doubt; of many shares some are outside by chance, so that the verdict
    /// is one against the intervals only where a p-value is below 1 % over their number (Bonferroni), or where the share
    /// over all unknowns is outside its band. Truths at the edges, of all unknowns, are judged by such a p-value too.
    pub(super) fn of(rows: &[Row], all: Option<&Row>, calibrated: usize, failed: usize) -> Self {
        let counted: Vec<&Row> = rows.iter().filter(|row| row.of_prior).collect();
        let Some(all) = all.filter(|_| calibrated > 0) else {
            let text =
                "no truth was calibrated, so that nothing can be said of the intervals".to_owned();
            return Self { word: Word::Nothing, text };
        };
        let number: usize = counted.iter().map(|row| row.levels.len()).sum();
        let limit = ALPHA / number.max(1) as f64;
        let outside = |side: Side| -> Vec<(&Row, &Rate)> {
            counted
                .iter()
                .flat_map(|row| row.levels.iter().map(move |rate| (*row, rate)))
                .filter(|(_, rate)| rate.side == side)
                .collect()
        };
        let sure = |side: Side| {
            outside(side).iter().any(|(_, rate)| rate.p_value < limit)
                || all.levels.iter().any(|rate| rate.side == side)
        };
        let told = |side: Side| {
            let of_all = all.levels.iter().filter(|r| r.side == side).map(|rate| (all, rate));
            let mut list: Vec<String> =
                of_all.chain(outside(side)).map(|(r, rate)| say(r, rate)).collect();
            list.truncate(4);
            list.join(", ")
        };
        let bent: Vec<&str> = counted
            .iter()
            .filter(|row| row.uniform_jointly == Some(false))
            .map(|row| row.name.as_str())
            .collect();
        let slightly: Vec<&str> =
            counted.iter().filter(|r| r.uniform == Some(false)).map(|r| r.name.as_str()).collect();
        let total = calibrated + failed;
        if sure(Side::Below) {
            let text = format!(
                "the intervals hold the truth less often than they say: {}",
                told(Side::Below)
            );
            return Self { word: Word::TooNarrow, text };
        }
        if let Some(rate) = worst(&all.edge).filter(|rate| rate.p_value < limit) {
            let text =
                format!("the intervals hold the truth less often than they say {}", at_edges(rate));
            return Self { word: Word::TooNarrow, text };
        }
        if sure(Side::Above) {
            let text = format!("the intervals are wider than they say: {}", told(Side::Above));
            return Self { word: Word::TooWide, text };
        }
        if !bent.is_empty() {
            let text = format!(
                "the shares are compatible with what the intervals say, but the ranks of the truth are not uniform: {}",
                quoted(&bent)
            );
            return Self { word: Word::NotUniform, text };
        }
        if failed as f64 > FAILED * total as f64 {
            let text =
                format!("{failed} of {total} calibrations failed, so that the others say little");
            return Self { word: Word::Doubtful, text };
        }
        let doubtful: Vec<&str> = [Side::Below, Side::Above]
            .into_iter()
            .filter(|&side| !outside(side).is_empty())
            .map(|side| if side == Side::Below { "below" } else { "above" })
            .collect();
        let edge = worst(&all.edge).map(at_edges);
        if !doubtful.is_empty() || !slightly.is_empty() || edge.is_some() {
            let shares = [Side::Below, Side::Above].map(told).into_iter().filter(|t| !t.is_empty());
            let ranks = (!slightly.is_empty()).then(|| format!("ranks of {}", quoted(&slightly)));
            let list: Vec<String> = shares.chain(ranks).chain(edge).collect();
            let text = format!(
                "outside the 99 % band, though of so many counts one may be by chance: {}; count more truths",
                list.join(", ")
            );
            return Self { word: Word::Doubtful, text };
        }
        let text = format!(
            "the intervals hold the truth as often as they say, as far as {calibrated} truths can tell"
        );
        Self { word: Word::Nominal, text }
    }
}

/// The rate that is furthest below its band.
fn worst(rates: &[Rate]) -> Option<&Rate> {
    let below = rates.iter().filter(|rate| rate.side == Side::Below);
    below.min_by(|a, b| a.p_value.total_cmp(&b.p_value))
}

/// Such as: at the edges of the priors: 95 % interval 78.0 % (expected 94.8 %).
fn at_edges(rate: &Rate) -> String {
    format!(
        "at the edges of the priors: {:.0} % interval {:.1} % (expected {:.1} %)",
        100.0 * rate.nominal,
        100.0 * rate.share,
        100.0 * rate.expected
    )
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Such as: 95 % of `rate`: 80.5 % (band 90.5 to 98.5 %).
fn say(row: &Row, rate: &Rate) -> String {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let of = if row.ranks.is_empty() { "all".to_owned() } else { format!("`{}`", row.name) };
    format!(
        "{:.0} % interval of {of} {} % (band {} to {} %)",
        100.0 * rate.nominal,
        percent(rate.share),
        percent(rate.band[0]),
        percent(rate.band[1])
    )
}

//! Verdict on the coverage of a study's intervals, in words.

use serde::{Deserialize, Serialize};

use super::{Rate, Row, Side};

/// Probability that chance alone leaves a band.
pub const ALPHA: f64 = 0.01;

/// Fraction of failed calibrations above which the remaining ones say little.
const FAILED: f64 = 0.05;

/// Verdict on the coverage of a study's intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Verdict in one word.
    pub word: Word,
    /// Verdict as a sentence.
    pub text: String,
}

/// Verdict in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// All fractions are inside their bands.
    Nominal,
    /// A fraction is outside its own band but inside the one corrected for the number of fractions; or too many
    /// calibrations failed.
    Doubtful,
    /// The intervals contain the truth less often than their probability.
    TooNarrow,
    /// The intervals contain the truth more often than their probability.
    TooWide,
    /// The coverage is right, but the ranks are not uniform.
    NotUniform,
    /// There was nothing to count.
    Nothing,
}

impl Verdict {
    /// Judges each unknown whose truths were drawn from its prior, at each level, and all together.
    ///
    /// A fraction outside its own 99 % band makes the result doubtful. Of many fractions some are outside by chance, so
    /// the verdict goes against the intervals only if a p-value is below 1 % divided by their number (Bonferroni), or
    /// if the fraction over all unknowns is outside its band. Truths at the edges, over all unknowns, are judged by
    /// such a p-value too.
    pub(super) fn of(rows: &[Row], all: Option<&Row>, calibrated: usize, failed: usize) -> Self {
        let counted: Vec<&Row> = rows.iter().filter(|row| row.of_prior).collect();
        let Some(all) = all.filter(|_| calibrated > 0) else {
            let text =
                "no calibration succeeded, so nothing is known about the intervals".to_owned();
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
                "the intervals contain the truth less often than their nominal probability: {}",
                told(Side::Below)
            );
            return Self { word: Word::TooNarrow, text };
        }
        if let Some(rate) = worst(&all.edge).filter(|rate| rate.p_value < limit) {
            let text = format!(
                "the intervals contain the truth less often than their nominal probability {}",
                at_edges(rate)
            );
            return Self { word: Word::TooNarrow, text };
        }
        if sure(Side::Above) {
            let text = format!(
                "the intervals contain the truth more often than their nominal probability: {}",
                told(Side::Above)
            );
            return Self { word: Word::TooWide, text };
        }
        if !bent.is_empty() {
            let text = format!(
                "the intervals contain the truth as often as expected, but the ranks of the truths are not uniform: {}",
                quoted(&bent)
            );
            return Self { word: Word::NotUniform, text };
        }
        if failed as f64 > FAILED * total as f64 {
            let text = format!(
                "{failed} of {total} calibrations failed, so the remaining ones mean little"
            );
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
                "outside the 99 % band, which may be chance with this many counts: {}; use more truths",
                list.join(", ")
            );
            return Self { word: Word::Doubtful, text };
        }
        let text = format!(
            "nominal: the intervals contain the truth as often as expected, within the precision of {calibrated} truths"
        );
        Self { word: Word::Nominal, text }
    }
}

/// The rate that is furthest below its band.
fn worst(rates: &[Rate]) -> Option<&Rate> {
    let below = rates.iter().filter(|rate| rate.side == Side::Below);
    below.min_by(|a, b| a.p_value.total_cmp(&b.p_value))
}

/// Text such as: at the edges of the priors: 95 % interval 78.0 % (expected 94.8 %).
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

/// Text such as: 95 % of `rate`: 80.5 % (band 90.5 to 98.5 %).
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

//! Entries of the gate: what is counted for each printed uncertainty.

use generator::line;
use lacuna::diagnose::coverage::binomial;
use serde_json::Value;

use super::lines::Case;

/// Coverage of a printed uncertainty.
#[derive(Debug, Clone)]
pub struct Count {
    /// Name of the entry.
    pub name: &'static str,
    /// Description of what was counted.
    pub what: &'static str,
    /// Nominal coverage.
    pub nominal: f64,
    /// Known reason for a deviation.
    pub open: Option<&'static str>,
    /// Number of cases inside.
    pub inside: usize,
    /// Number of cases counted.
    pub of: usize,
}

impl Count {
    /// Counts that 99 % of such experiments give if the coverage is nominal.
    pub fn band(&self) -> [usize; 2] {
        binomial::band(self.of, self.nominal, 0.005)
    }

    /// Returns true if the count is inside the band.
    pub fn holds(&self) -> bool {
        (self.band()[0]..=self.band()[1]).contains(&self.inside)
    }
}

/// A printed uncertainty and the truth that it should contain.
pub struct Entry {
    /// Name of the entry.
    pub name: &'static str,
    /// Description of what is counted.
    pub what: &'static str,
    /// Nominal coverage.
    pub nominal: f64,
    /// Known reason for a deviation, as long as it is not fixed.
    pub open: Option<&'static str>,
    /// Tests a case: true if the uncertainty contains the truth; `None` if the case does not apply.
    pub test: fn(&Case) -> Option<bool>,
}

const NAMES: [&str; 2] = ["level0", "rise"];

fn number(case: &Case, path: &str) -> f64 {
    case.summary.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {path}"))
}

/// A printed number of the parameter with this index.
fn of(case: &Case, j: usize, key: &str) -> f64 {
    number(case, &format!("/parameters/{}/{key}", NAMES[j]))
}

fn exact_sd(case: &Case, j: usize) -> f64 {
    case.exact.covariance[j][j].sqrt()
}

/// Probability within two standard deviations of a normal distribution.
const TWO: f64 = 0.954_5;

/// All entries that are counted with straight lines.
pub const LINES: [Entry; 9] = [
    Entry {
        name: "posterior_interval",
        what: "the truth of `rise` between `q025` and `q975`",
        nominal: 0.95,
        open: None,
        test: |case| {
            let truth = case.truth[1];
            Some(of(case, 1, "q025") <= truth && truth <= of(case, 1, "q975"))
        },
    },
    Entry {
        name: "posterior_sd",
        what: "the truth of `level0` within two `sd` of `mean`",
        nominal: TWO,
        open: None,
        test: |case| {
            let off = case.truth[0] - of(case, 0, "mean");
            Some(off.abs() <= 2.0 * of(case, 0, "sd"))
        },
    },
    Entry {
        name: "posterior_median",
        what: "the truth of `rise` below `median`",
        nominal: 0.5,
        open: None,
        test: |case| Some(case.truth[1] < of(case, 1, "median")),
    },
    Entry {
        name: "mcse_mean",
        what: "the exact posterior mean of `rise` within two `mcse_mean` of `mean`",
        nominal: TWO,
        open: None,
        test: |case| {
            let off = case.exact.mean[1] - of(case, 1, "mean");
            Some(off.abs() <= 2.0 * of(case, 1, "mcse_mean"))
        },
    },
    Entry {
        name: "evidence_error",
        what: "the exact log evidence within two `evidence.error` of `evidence.log`",
        nominal: TWO,
        open: None,
        test: |case| {
            let off = case.exact.log_evidence - number(case, "/evidence/log");
            Some(off.abs() <= 2.0 * number(case, "/evidence/error"))
        },
    },
    Entry {
        name: "elpd_error",
        what: "the expected log density of new data within two `loo.error` of `loo.elpd`",
        nominal: TWO,
        open: Some("the scatter of two dozen terms says too little of the error of their sum"),
        test: |case| {
            let off = case.elpd - number(case, "/loo/elpd");
            Some(off.abs() <= 2.0 * number(case, "/loo/error"))
        },
    },
    Entry {
        name: "predictive_band",
        what: "the last value of a new replicate inside the 95 % band",
        nominal: 0.95,
        open: None,
        test: |case| {
            let last = line::TIMES.len() - 1;
            Some(case.band.0[last] <= case.new[last] && case.new[last] <= case.band.1[last])
        },
    },
    Entry {
        name: "converged",
        what: "`converged` where the mean of `rise` is within a fifth of a posterior sd of the exact one",
        nominal: 0.999,
        open: None,
        test: |case| {
            let right = (of(case, 1, "mean") - case.exact.mean[1]).abs() < 0.2 * exact_sd(case, 1);
            (case.summary["converged"] == Value::Bool(true)).then_some(right)
        },
    },
    Entry {
        name: "spread",
        what: "the first value of a new replicate within two `spread` (all origins) of the predicted mean",
        nominal: TWO,
        open: None,
        test: |case| {
            let parts = case.summary["spread"].as_object()?;
            let own = parts.iter().filter(|(origin, _)| *origin != "replicates");
            let variance: f64 = own.filter_map(|(_, sd)| sd.as_f64()).map(|sd| sd * sd).sum();
            let mean = of(case, 0, "mean") + of(case, 1, "mean") * line::TIMES[2];
            let exact = &case.exact.covariance;
            let t = line::TIMES[2];
            let of_parameters = exact[0][0] + 2.0 * exact[0][1] * t + exact[1][1] * t * t;
            Some((case.new[2] - mean).abs() <= 2.0 * (variance + of_parameters).sqrt())
        },
    },
];

/// Counts an entry over cases.
pub fn count(entry: &Entry, cases: &[Case]) -> Count {
    let held: Vec<bool> = cases.iter().filter_map(entry.test).collect();
    Count {
        name: entry.name,
        what: entry.what,
        nominal: entry.nominal,
        open: entry.open,
        inside: held.iter().filter(|held| **held).count(),
        of: held.len(),
    }
}

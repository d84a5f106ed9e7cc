//! The keys of `[[dependence]]` and `[[constraint]]`.

use lacuna::text::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::matrix::Correlations;

/// Parameters whose priors depend on each other. Each keeps its own `prior`; a copula, or a Dirichlet distribution of shares,
/// joins them. A parameter belongs to one `[[dependence]]` at most; all others are independent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DependenceSection {
    /// Names of the parameters: at least two; in a Dirichlet distribution all shares but the last.
    pub parameters: Vec<String>,
    /// Copula. Default: `gaussian`, the dependence of a multivariate normal distribution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copula: Option<CopulaName>,
    /// Correlation of the normal scores, which for normal priors is that of the parameters: one number for two parameters,
    /// or a symmetric matrix such as `[[1, 0.6, 0.1], [0.6, 1, 0], [0.1, 0, 1]]`, positive definite. For `student_t` the
    /// correlation of that distribution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlation: Option<Correlations>,
    /// Spearman's rank correlation in place of `correlation`; for the Gaussian copula only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spearman: Option<Correlations>,
    /// Kendall's rank correlation tau in place of `correlation` or `theta`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kendall: Option<Correlations>,
    /// Degrees of freedom of `student_t`. The smaller they are, the more often extremes occur together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<Positive>,
    /// Parameter of `clayton`, `gumbel` or `frank`, as in Nelsen (2006).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub theta: Option<f64>,
    /// Concentrations of a Dirichlet distribution of shares whose sum is 1, one more than there are parameters: the last share
    /// is what the others leave, such as `1 - w1 - w2`. The parameters then need no `prior`; it is the beta distribution that
    /// follows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dirichlet: Option<Vec<Positive>>,
}

/// Name of a copula.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CopulaName {
    /// Dependence of a multivariate normal distribution; none in the far tails.
    Gaussian,
    /// Dependence of a multivariate Student t distribution: extremes occur together, of both signs.
    StudentT,
    /// Two parameters that are small together.
    Clayton,
    /// Two parameters that are large together.
    Gumbel,
    /// Two parameters whose dependence is weak in both tails; also negative.
    Frank,
}

impl CopulaName {
    /// The name as a study writes it.
    pub(super) fn written(self) -> &'static str {
        match self {
            Self::Gaussian => "gaussian",
            Self::StudentT => "student_t",
            Self::Clayton => "clayton",
            Self::Gumbel => "gumbel",
            Self::Frank => "frank",
        }
    }
}

/// A condition that the parameters fulfil. The prior is zero where it does not hold, and larger elsewhere in the same
/// proportion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstraintSection {
    /// Condition on parameters that all scenarios share: comparisons such as `"k1 < k2"` or
    /// `"k1 + k2 <= 3 {N/m}"`, which `and`, `or` and `not` combine. The compared sides have the same unit. Prefer `<` to
    /// `==`: a condition that almost no draw of the priors fulfils is refused.
    pub formula: String,
}

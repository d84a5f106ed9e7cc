//! The gap workflow: where simulation and data disagree, which effect the model lacks, and whether the gap shrinks with
//! it.
//!
//! The parts, in the order of the workflow; each uses those before it alone:
//!
//! | part | does |
//! |---|---|
//! | [`experiment`] | sorts measurements by condition and curve, holds out what [`prove`] needs, and joins them with a forward map |
//! | [`candidates`] | the effects that may be missing, and their placements |
//! | [`noise`] | estimates the noise from the replicates, or from single records |
//! | [`system`] | the forward map with effects: best fit, whitening, covariance of the emulator's error |
//! | [`mod@test`] | three tests of the residual, with null distributions by parametric bootstrap; regions of disagreement |
//! | [`search`] | forward selection by Bayes factors; cross-validation and discrimination; the verdict |
//! | [`unlisted`] | describes what no candidate explains: regions in words, a symbolic form, a smoother |
//! | [`next`] | the bits that further measurements are expected to give on the name and on the parameters |
//! | [`drift`] | recalibrates the parameters by condition and window: is the model wrong, or a sensor? |
//! | [`prove`] | measures on held-out data whether the gap shrank |
//! | [`result`] | all of this as plain data |
//! | [`edit`] | changes of a study as text |
//! | [`inside`] | candidates inside the model: inputs set free, terms of equations, other models |
//! | [`law`] | where no candidate has a name: the rate that equations lack over time, and its law |
//! | [`stage`] | the stage of the program: from a study to its result, and to the study with the effects |
//! | [`power`] | injects effects and counts how often the workflow finds them |
//! | [`report`] | the section of the report, and the text for the terminal |
//!
//! # Glossary
//!
//! | term | in the literature | source |
//! |---|---|---|
//! | gap | model discrepancy, measured by the excess of the whitened mean square residual over that of noise | Kennedy and O'Hagan, Journal of the Royal Statistical Society B 63 (2001) 425 |
//! | effect, [`Candidate`](candidates::Candidate) | a parametric form of the discrepancy; a candidate of the selection | |
//! | [`Placement`](candidates::Placement) | a candidate with the sensors on which it acts: a group in group sparsity | |
//! | held-out data | test set, used for neither calibration nor search | |
//! | [`Noise`](noise::Noise) | autoregressive errors with random effects of whole replicates, by restricted likelihood or by expectation and maximisation | Harville, Journal of the American Statistical Association 72 (1977) 320; Dempster, Laird and Rubin, Journal of the Royal Statistical Society B 39 (1977) 1 |
//! | covariance of the emulator's error ([`CommonError`](lacuna::plugin::discrepancy::CommonError), [`ErrorCovariance`](system::emulator_error::ErrorCovariance)) | code uncertainty: a covariance `K` of the mean curve, the same for all replicates, so that the mean of `R` replicates has `S / R + K`; `K = F F'` with one column of `F` an error, the rest shrunk to a diagonal | Kennedy and O'Hagan 2001; Ledoit and Wolf, Journal of Multivariate Analysis 88 (2004) 365 |
//! | residual | the replicates' mean less the calibrated response, whitened and projected off the slopes of the unknowns | Cox and Hinkley, Theoretical Statistics, section 9.3 |
//! | [`DesignMatrix`](test::DesignMatrix) | the whitened derivatives of the response by the size of each placement, off the slopes of the unknowns | |
//! | [`Scores`](test::Scores) | Rao's efficient score test with nuisance parameters, studentised with a moderated variance | Cox and Hinkley, section 9.3; Smyth, Statistical Applications in Genetics and Molecular Biology 3 (2004) 3 |
//! | [`Scan`](test::Scan) | multiscale scan statistic | Dümbgen and Spokoiny, Annals of Statistics 29 (2001) 124 |
//! | [`NullDistribution`](test::NullDistribution) | parametric bootstrap, with sequential p-values | Besag and Clifford, Biometrika 78 (1991) 301 |
//! | [`Region`](test::Region) | a rejected hypothesis of a step-down procedure that keeps the familywise error rate | Romano and Wolf, Journal of the American Statistical Association 100 (2005) 94 |
//! | [`SearchState`](search) | the current model of forward selection with exchanges and deletions | |
//! | [`Diagnostics`](search::Diagnostics) | the test statistics and p-values of a model | |
//! | [`LogEvidence`](search::LogEvidence) | log marginal likelihood, by Laplace's method and importance sampling | Geweke, Econometrica 57 (1989) 1317 |
//! | [`BayesFactor`](inside::BayesFactor), `log_odds` | ratio of two marginal likelihoods; times the prior masses, posterior odds. 20 to 1 is strong evidence | Kass and Raftery, Journal of the American Statistical Association 90 (1995) 773 |
//! | class | a set of types that together has 95 % of the posterior probability | |
//! | [`cross_validate`](search::cross_validate) | leave-group-out cross-validation: joint log predictive density of what is left out | Bürkner, Gabry and Vehtari, Computational Statistics 36 (2021) 1243 |
//! | [`NameProof`](result::names::NameProof) | comparison with a nonparametric alternative on left-out groups | Bürkner, Gabry and Vehtari 2021 |
//! | averages over a class | Bayesian model averaging | Hoeting et al., Statistical Science 14 (1999) 382 |
//! | [`discriminate`](search::discriminate) | design of experiments for model discrimination | |
//! | [`next`](next::next) | expected information gain: Bayesian design of experiments | Lindley, Annals of Mathematical Statistics 27 (1956) 986; Box and Hill, Technometrics 9 (1967) 57 |
//! | [`drift`](mod@drift) | parameters that vary between conditions as a sign of a wrong model; tests of equality in seemingly unrelated regressions | Zellner, Journal of the American Statistical Association 57 (1962) 348 |
//! | [`Symbolic`](unlisted::Symbolic) | sparse regression over a dictionary with group sparsity | de Silva et al., Frontiers in Artificial Intelligence 3 (2020) 25 |
//! | [`Smoother`](unlisted::Smoother) | Gaussian process orthogonal to the sensitivities | Plumlee, Journal of the American Statistical Association 112 (2017) 1274 |
//! | coverage | share of held-out values inside the 95 % band | |
//! | [`Traits`](search::Traits), [`Reliability`](search::Reliability) | calibration of probabilities; reliability diagram, Brier score with its parts | Murphy, Journal of Applied Meteorology 12 (1973) 595; Niculescu-Mizil and Caruana, ICML 2005 |
//! | injection | injection and recovery: power by simulation | |

pub mod candidates;
pub mod drift;
pub mod edit;
pub mod experiment;
pub mod inside;
pub mod law;
pub mod next;
pub mod noise;
pub mod power;
pub mod prove;
pub mod report;
pub mod result;
pub mod search;
pub mod stage;
pub mod system;
pub mod test;
pub mod unlisted;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

//! The law of a missing rate as plain data: the force over time that was inferred, the law, and its proof.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use serde::{Deserialize, Serialize};

use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::prove::Proof;
use crate::page::number::significant;

/// A missing rate of a state of the model, and the law that describes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Law {
    /// True if held-out data confirm the law: its terms are among the effects that were found.
    pub accepted: bool,
    /// The reason, in words, for which it is a description only; `None` if it is accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The share of what a free force explains that the law explains, as energies of the whitened misfit.
    pub explained: f64,
    /// The number of forms that were compared.
    pub tried: usize,
    /// The force over time.
    pub force: Force,
    /// The terms of the law; empty if no form of the dictionary describes the force.
    pub terms: Vec<LawTerm>,
    /// Other forms in place of the only term, whose evidence is less by at most 20 to 1.
    #[serde(default)]
    pub rivals: Vec<LawTerm>,
    /// The calibrated parameters of the study beside it.
    #[serde(default)]
    pub parameters: Vec<f64>,
    /// The proof on a condition or on blocks that were held out; `None` if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<LawProof>,
}

/// The missing rate of a state as a function of time, of which no form is assumed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Force {
    /// The state to whose rate it is added.
    pub state: String,
    /// The unit of the force: that of the rate.
    pub unit: Unit,
    /// The log Bayes factor against no force, with the hyperparameters of largest evidence.
    pub log_evidence: f64,
    /// The share of the excess misfit that it explains.
    pub explained: f64,
    /// The quantity of the law's first term, along which it is shown besides the time; `None` without a law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// The force under each condition.
    pub curves: Vec<ForceCurve>,
}

/// The force under one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForceCurve {
    /// The scenario; `None` if the study has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// The times, in the unit of the model's axis.
    pub at: Vec<f64>,
    /// The posterior mean.
    pub mean: Vec<f64>,
    /// The posterior standard deviation.
    pub sd: Vec<f64>,
    /// The law along the same run; empty without a law.
    pub law: Vec<f64>,
    /// The quantity of the law's first term along the same run; empty without a law.
    pub of: Vec<f64>,
}

/// A term of a law: a summand of the rate of a state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LawTerm {
    /// The name of its coefficient.
    pub name: String,
    /// The state to whose rate it is added.
    pub state: String,
    /// The expression that the coefficient multiplies.
    pub shape: String,
    /// The quantity that it is a function of, as an expression.
    pub of: String,
    /// The description in words.
    pub title: String,
    /// The formula as a reader would write it.
    pub formula: String,
    /// The coefficient, with a prior about zero.
    pub coefficient: LawUnknown,
    /// The exponent or the threshold, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<LawUnknown>,
    /// The number of forms among which it was chosen.
    pub tried: usize,
    /// The share of random halves of the data in which a form of this kind is chosen.
    pub stability: f64,
}

/// An unknown of a term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LawUnknown {
    /// The name.
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// The value of largest posterior density.
    pub value: f64,
    /// The standard deviation, by the normal approximation.
    pub sd: f64,
    /// The prior.
    pub prior: Distribution,
}

/// The comparison of a law with data that were used neither to choose nor to fit it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LawProof {
    /// The kind of the data that were held out.
    pub kind: HeldOutKind,
    /// The names of the parts.
    pub names: Vec<String>,
    /// The log predictive density of the held-out values under the law less that under the free force.
    pub against_force: f64,
    /// The comparison with the model without the law.
    pub proof: Proof,
}

impl Law {
    /// The law, or what the missing rate looks like, in words.
    pub fn words(&self) -> Vec<String> {
        let state = &self.force.state;
        let force = &self.force;
        let first = format!(
            "The equations lack a rate of `{state}`: a force over time of which no form is assumed explains {:.0} % of the gap \
             (log Bayes factor {:.0}).",
            100.0 * force.explained,
            force.log_evidence
        );
        let mut all = vec![first];
        if self.terms.is_empty() {
            let reason = self.reason.as_deref().unwrap_or("no form describes it");
            all.push(format!("It has no law: {reason}."));
            return all;
        }
        let values: Vec<String> = self.terms.iter().flat_map(LawTerm::values).collect();
        let stability: Vec<String> =
            self.terms.iter().map(|term| format!("{:.0} %", 100.0 * term.stability)).collect();
        let (begins, ends) = if self.accepted {
            ("It follows the law".to_owned(), String::new())
        } else {
            let reason = self.reason.as_deref().unwrap_or("it was not proven");
            ("It looks like".to_owned(), format!(" This is a description and no law: {reason}."))
        };
        all.push(format!(
            "{begins} {}, with {}: {:.0} % of what the free force explains; forms of this kind are chosen in {} of \
             random halves of the data, among {} forms.{ends}",
            self.formula(),
            values.join(", "),
            100.0 * self.explained,
            stability.join(" and "),
            self.tried
        ));
        all.extend(self.proof.as_ref().map(LawProof::words));
        if !self.rivals.is_empty() {
            let rivals: Vec<String> = self
                .rivals
                .iter()
                .map(|term| format!("{}' = … + {}", term.state, term.formula))
                .collect();
            all.push(format!(
                "Other forms describe these data about as well: {}.",
                rivals.join("; ")
            ));
        }
        all
    }
}

impl Law {
    /// The terms and the rivals: all that a search has among its candidates.
    pub fn candidates(&self) -> Vec<LawTerm> {
        self.terms.iter().chain(&self.rivals).cloned().collect()
    }

    /// True if a search kept all terms.
    pub fn is_kept_in(&self, kinds: &[&str]) -> bool {
        self.terms.iter().all(|term| kinds.contains(&term.name.as_str()))
    }

    /// The rates with the terms, as a reader would write them.
    fn formula(&self) -> String {
        let mut states: Vec<&str> = Vec::new();
        for term in &self.terms {
            if !states.contains(&term.state.as_str()) {
                states.push(&term.state);
            }
        }
        let rate = |state: &&str| {
            let own = self.terms.iter().filter(|term| term.state == **state);
            let own: Vec<&str> = own.map(|term| term.formula.as_str()).collect();
            format!("{state}' = … + {}", own.join(" + "))
        };
        states.iter().map(rate).collect::<Vec<_>>().join(" and ")
    }
}

impl LawTerm {
    /// The term under another name.
    #[must_use]
    pub fn renamed(mut self, name: &str) -> Self {
        if let Some(index) = &mut self.index {
            let new = index.name.replace(&self.name, name);
            self.shape = self.shape.replace(&index.name, &new);
            index.name = new;
        }
        self.formula = self.formula.replace(&self.name, name);
        name.clone_into(&mut self.coefficient.name);
        name.clone_into(&mut self.name);
        self
    }

    /// The unknowns with their values, in words.
    fn values(&self) -> Vec<String> {
        let all = std::iter::once(&self.coefficient).chain(&self.index);
        let value = |unknown: &LawUnknown| {
            let unit = match unknown.unit.as_str() {
                "" | "1" => String::new(),
                unit => format!(" {unit}"),
            };
            let [value, sd] = [(unknown.value, 4), (unknown.sd, 2)].map(|(x, n)| significant(x, n));
            format!("`{}` = {value} ± {sd}{unit}", unknown.name)
        };
        all.map(value).collect()
    }
}

impl LawProof {
    /// The proof in words.
    fn words(&self) -> String {
        let all = &self.proof.all;
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let than = if self.against_force < 0.0 { "worse" } else { "better" };
        format!(
            "On {} that were used neither to choose nor to fit it the law closes {} of the gap ({} to {}), and predicts {than} \
             than the free force, log score {:+.1}.",
            self.kind.words(),
            percent(all.closed),
            percent(all.lower),
            percent(all.upper),
            self.against_force
        )
    }
}

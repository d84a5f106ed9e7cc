//! The keys of a missing rate and its law.

use schemars::JsonSchema;
use serde::Serialize;

use super::held_out::HeldOut;
use crate::gap::result::HeldOut as Compared;
use crate::gap::result::law::{Law as Found, LawProof, LawTerm, LawUnknown};
use crate::report::summary::value::{ByName, Quantity};

/// Missing rate of a state of the model, and the law that describes it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Law {
    /// True if held-out data confirm the law: its terms are among `effects` then, and in the study that is written.
    pub accepted: bool,
    /// Reason for which it is a description only; `null` if it is accepted.
    pub reason: Option<String>,
    /// State to whose rate a force is missing.
    pub state: String,
    /// Unit of the force: that of the rate.
    pub unit: String,
    /// Share of the gap that a force over time explains of which no form is assumed.
    pub force_explained: Quantity,
    /// Logarithm of the probability of the data with that force over that without it.
    pub force_log_evidence: Quantity,
    /// Share of what that force explains that the law explains.
    pub explained: Quantity,
    /// Number of forms that were compared.
    pub tried: usize,
    /// Terms of the law; empty if no form describes the force.
    pub terms: Vec<Term>,
    /// Comparison with data that were used neither to choose nor to fit the law; `null` if nothing could be held out.
    pub held_out: Option<HeldOut>,
    /// Log predictive density of these data under the law minus that under the force; `null` without such data.
    pub against_force: Option<Quantity>,
}

/// Term of a law: a summand of the rate of a state.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Term {
    /// Name of the term and of its coefficient.
    pub name: String,
    /// State to whose rate it is added.
    pub state: String,
    /// Quantity of which it is a function.
    pub of: String,
    /// Formula, as a reader would write it.
    pub formula: String,
    /// Expression in the language of the equations that the coefficient multiplies.
    pub shape: String,
    /// Coefficient, and exponent or threshold if the form has one.
    #[schemars(extend("propertyNames" = { "title": "unknown" }))]
    pub parameters: ByName<Parameter>,
    /// Share of random halves of the data in which a form of this kind is chosen.
    pub stability: Quantity,
}

/// Unknown of a term at the best fit.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Parameter {
    /// Maximum of the posterior density.
    pub map: Quantity,
    /// Standard deviation of the normal approximation.
    pub sd: f64,
    /// Unit of the unknown.
    pub unit: String,
}

impl Law {
    pub fn of(law: &Found) -> Self {
        let force = &law.force;
        Self {
            accepted: law.accepted,
            reason: law.reason.clone(),
            state: force.state.clone(),
            unit: force.unit.to_string(),
            force_explained: force.explained.into(),
            force_log_evidence: force.log_evidence.into(),
            explained: law.explained.into(),
            tried: law.tried,
            terms: law.terms.iter().map(Term::of).collect(),
            held_out: law.proof.as_ref().map(held_out),
            against_force: law.proof.as_ref().map(|proof| proof.against_force.into()),
        }
    }
}

fn held_out(proof: &LawProof) -> HeldOut {
    let LawProof { kind, names, proof, .. } = proof.clone();
    HeldOut::of(&Compared { kind, names, proof, accuracy: None })
}

impl Term {
    fn of(term: &LawTerm) -> Self {
        let unknowns = std::iter::once(&term.coefficient).chain(&term.index);
        let parameter = |unknown: &LawUnknown| {
            let LawUnknown { value, sd, unit, .. } = unknown;
            let parameter = Parameter { map: (*value).into(), sd: *sd, unit: unit.to_string() };
            (unknown.name.clone(), parameter)
        };
        Self {
            name: term.name.clone(),
            state: term.state.clone(),
            of: term.of.clone(),
            formula: term.formula.clone(),
            shape: term.shape.clone(),
            parameters: unknowns.map(parameter).collect(),
            stability: term.stability.into(),
        }
    }
}

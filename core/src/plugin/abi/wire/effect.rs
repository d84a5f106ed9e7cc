//! What effects are, and what they look at.

use serde::{Deserialize, Serialize};

use crate::data::Layouts;
use crate::plugin::effect::{Description, Reach, Situation};

/// An effect in words, with where it may act.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EffectAbout {
    title: String,
    formula: String,
    source: String,
    reach: String,
}

impl EffectAbout {
    /// What an effect says of itself.
    pub fn new(description: Description, reach: Reach) -> Self {
        let reach = match reach {
            Reach::Any => "any",
            Reach::Single => "single",
            Reach::Whole => "whole",
        };
        let Description { title, formula, source } = description;
        Self { title, formula, source, reach: reach.to_owned() }
    }

    /// The words.
    pub fn description(self) -> Description {
        Description { title: self.title, formula: self.formula, source: self.source }
    }

    /// Where it may act; anywhere when nothing is said.
    pub fn reach(&self) -> Reach {
        match self.reach.as_str() {
            "single" => Reach::Single,
            "whole" => Reach::Whole,
            _ => Reach::Any,
        }
    }
}

/// A [`Situation`] that owns what it says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OwnedSituation {
    layouts: Layouts,
    response: Vec<f64>,
    noise: Vec<f64>,
}

impl From<&Situation<'_>> for OwnedSituation {
    fn from(situation: &Situation<'_>) -> Self {
        Self {
            layouts: situation.layouts.clone(),
            response: situation.response.to_vec(),
            noise: situation.noise.to_vec(),
        }
    }
}

impl OwnedSituation {
    /// The same as effects look at it.
    pub fn view(&self) -> Situation<'_> {
        Situation { layouts: &self.layouts, response: &self.response, noise: &self.noise }
    }
}

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
    reach: ReachAbout,
}

/// Where it may act; anywhere when nothing is said.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ReachAbout {
    #[default]
    Any,
    Single,
    Whole,
}

impl EffectAbout {
    /// What an effect says of itself.
    pub fn new(description: Description, reach: Reach) -> Self {
        let reach = match reach {
            Reach::Any => ReachAbout::Any,
            Reach::Single => ReachAbout::Single,
            Reach::Whole => ReachAbout::Whole,
        };
        let Description { title, formula, source } = description;
        Self { title, formula, source, reach }
    }

    /// The words.
    pub fn description(self) -> Description {
        Description { title: self.title, formula: self.formula, source: self.source }
    }

    /// Where it may act.
    pub fn reach(&self) -> Reach {
        match self.reach {
            ReachAbout::Any => Reach::Any,
            ReachAbout::Single => Reach::Single,
            ReachAbout::Whole => Reach::Whole,
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

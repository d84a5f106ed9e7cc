//! Descriptions of effects, and the data for which effects are proposed.

use lacuna::data::Layouts;
use lacuna::plugin::effect::{Description, Reach, Situation};
use serde::{Deserialize, Serialize};

/// Description of an effect and the curves on which it may act.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EffectAbout {
    title: String,
    formula: String,
    source: String,
    reach: ReachAbout,
}

/// Curves on which the effect may act; any if not given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ReachAbout {
    #[default]
    Any,
    Single,
    Whole,
}

impl EffectAbout {
    /// An effect in words.
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

    /// The sensors on which it may act.
    pub fn reach(&self) -> Reach {
        match self.reach {
            ReachAbout::Any => Reach::Any,
            ReachAbout::Single => Reach::Single,
            ReachAbout::Whole => Reach::Whole,
        }
    }
}

/// A [`Situation`] that owns its data.
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
    /// Returns the situation as a borrowed view.
    pub fn view(&self) -> Situation<'_> {
        Situation { layouts: &self.layouts, response: &self.response, noise: &self.noise }
    }
}

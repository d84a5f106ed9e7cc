//! A study as it is run: plugins built, priors and units checked, everything consistent. Plain data; `resolve` makes it.

use std::ops::Deref;
use std::path::PathBuf;
use std::sync::Arc;

use lacuna::data::{Dependence, Field, Layouts, Parameter, Scenario};
use lacuna::plugin::registry::Section;
use lacuna::plugin::{Effect, Given};
use lacuna::text::quantity::Quantity;
use toml::Table;

use super::dependence::Sections;
use super::fidelity::{LowFidelity, NumericalError};
use super::field::FieldSection;
use super::file::{DerivedSection, EffectKeys, StudySection, ValidateSection};
use super::forward::ForwardSection;
use super::gap::Gap;
use super::hierarchy::Hierarchy;
use super::libraries::Libraries;
use super::positions::Positions;
use super::quantity::QuantitySection;
use super::reliability::ReliabilitySection;
use super::start::StartSection;
use super::table::PluginSections;
use super::unknowns::Unknown;

/// A study that can be run. The sections that choose one plugin are its fields too: `study.model`.
pub struct Study {
    /// Name of the study: that of its `[study]`, else the stem of its file.
    pub name: String,
    /// True if the name is set in the study's own file or on the command line, and neither inherited from an extended
    /// study nor taken from the file name.
    pub named: bool,
    /// Path of the study file.
    pub file: PathBuf,
    /// Folder from which relative paths start: that of the study file, unless `directory` of `[study]` gives another.
    pub directory: PathBuf,
    /// Content of the study file, byte for byte.
    pub text: String,
    /// `[study]`.
    pub about: StudySection,
    /// `[plugins]`, with the libraries that were loaded.
    pub libraries: Libraries,
    /// The unknowns of the model.
    pub parameters: Vec<Parameter>,
    /// The known conditions; one without a name where the study has no scenarios.
    pub scenarios: Vec<Scenario>,
    /// Dependence of the priors of the parameters.
    pub dependence: Dependence,
    /// `[[dependence]]` and `[[constraint]]`.
    pub dependence_sections: Sections,
    /// Random fields, whose coefficients are the last parameters.
    pub fields: Vec<Arc<Field>>,
    /// `[[field]]`.
    pub field_sections: Vec<FieldSection>,
    /// Parameters by group.
    pub hierarchy: Hierarchy,
    /// Name and scenario behind each parameter, in the same order.
    pub unknowns: Vec<Unknown>,
    /// Model inputs that the study sets.
    pub given: Vec<Given>,
    /// The shapes of the responses to all scenarios.
    pub layouts: Layouts,
    /// The positions of labels along the axes of the responses.
    pub positions: Vec<Positions>,
    /// The sections that choose one plugin.
    pub plugins: PluginSections,
    /// `[numerical_error]`.
    pub numerical_error: Option<NumericalError>,
    /// `[low_fidelity]`.
    pub low_fidelity: Option<LowFidelity>,
    /// `[[start]]`.
    pub starts: Vec<StartSection>,
    /// `[[derived]]`.
    pub derived_sections: Vec<DerivedSection>,
    /// `[[effect]]`.
    pub effects: Vec<Section<dyn Effect, EffectKeys>>,
    /// `[[quantity]]`.
    pub quantities: Vec<QuantitySection>,
    /// `[forward]`.
    pub forward: Option<ForwardSection>,
    /// `[[reliability]]`.
    pub reliability: Vec<ReliabilitySection>,
    /// `[validate]`.
    pub validate: ValidateSection,
    /// `[gap]`.
    pub gap: Gap,
    /// The whole study with every default filled in, for `resolved.toml`.
    pub resolved: Table,
}

/// The parts of a study that has neither data nor what follows from them.
pub(super) struct Parts {
    /// The unknowns of the model.
    pub parameters: Vec<Parameter>,
    /// Name and scenario behind each parameter, in the same order.
    pub unknowns: Vec<Unknown>,
    /// The known conditions.
    pub scenarios: Vec<Scenario>,
    /// The shapes of the responses to all scenarios.
    pub layouts: Layouts,
    /// The sections that choose one plugin.
    pub plugins: PluginSections,
    /// `[gap]`.
    pub gap: Gap,
}

impl Study {
    /// A study of the same file that consists of these parts only: without data, errors, effects and quantities.
    pub(super) fn reduced_to(&self, parts: Parts) -> Self {
        let Parts { parameters, unknowns, scenarios, layouts, plugins, gap } = parts;
        let mut reduced = Self {
            name: self.name.clone(),
            named: self.named,
            file: self.file.clone(),
            directory: self.directory.clone(),
            text: String::new(),
            about: self.about.clone(),
            libraries: self.libraries.clone(),
            parameters,
            scenarios,
            dependence: Dependence::default(),
            dependence_sections: Sections::default(),
            fields: self.fields.clone(),
            field_sections: self.field_sections.clone(),
            hierarchy: Hierarchy::default(),
            unknowns,
            given: Vec::new(),
            layouts,
            positions: self.positions.clone(),
            plugins,
            numerical_error: None,
            low_fidelity: None,
            starts: Vec::new(),
            derived_sections: Vec::new(),
            effects: Vec::new(),
            quantities: Vec::new(),
            forward: None,
            reliability: Vec::new(),
            validate: ValidateSection::default(),
            gap,
            resolved: Table::new(),
        };
        reduced.given = super::inputs::all_given(&reduced);
        reduced
    }

    /// The study of a companion: the same conditions and responses, with these parameters, model and candidates, and with
    /// neither data nor surrogate.
    pub(super) fn companion_of(
        &self,
        parameters: Vec<Parameter>,
        unknowns: Vec<Unknown>,
        plugins: PluginSections,
        gap: Gap,
    ) -> Self {
        let (scenarios, layouts) = (self.scenarios.clone(), self.layouts.clone());
        let parts = Parts { parameters, unknowns, scenarios, layouts, plugins, gap };
        let mut companion = self.reduced_to(parts);
        companion.give_candidates();
        companion
    }

    /// Gives the model those inputs of `[[gap.switch]]` that it does not know of itself, as a command or a function knows
    /// none: at the values at which they are absent, 0 where none is stated.
    fn give_candidates(&mut self) {
        let unknown = |name: &str| !self.has_input(name) && self.takes(name);
        let switches = self.gap.inside.switches.iter().filter(|switch| unknown(&switch.input));
        let given = switches.map(|switch| {
            let value = switch.absent.unwrap_or(0.0);
            (switch.input.clone(), Quantity { value, unit: switch.unit.clone() })
        });
        let given: Vec<(String, Quantity)> = given.collect();
        if let Some(model) = self.plugins.model.as_mut().filter(|_| !given.is_empty()) {
            model.common.fixed.extend(given);
            self.given = super::inputs::all_given(self);
        }
    }
}

impl Deref for Study {
    type Target = PluginSections;

    fn deref(&self) -> &PluginSections {
        &self.plugins
    }
}

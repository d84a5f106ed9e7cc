//! The source of each input's value.

use lacuna::plugin::model::Input;
use lacuna::run::Stop;

use super::Other;
use crate::study::Study;
use crate::study::inputs::Computed;

/// Source of an input's value.
pub(super) enum Source {
    Fixed(f64),
    /// Index of a parameter of the study and the factor from its unit to the input's.
    Parameter(usize, f64),
    /// Index of an expression and the factor from its unit to the input's.
    Computed(usize, f64),
    /// The seed of the run.
    Seed,
}

impl Source {
    /// Parameters on which the value depends; for an expression, those of all expressions.
    pub fn parameters(&self, computed: Option<&Computed>) -> Vec<usize> {
        match self {
            Self::Fixed(_) | Self::Seed => Vec::new(),
            Self::Parameter(i, _) => vec![*i],
            Self::Computed(..) => computed.map_or_else(Vec::new, |all| all.parameters.clone()),
        }
    }
}

/// The source of an input under the conditions of a scenario.
pub(super) fn source(
    study: &Study,
    other: &Other<'_>,
    scenario: usize,
    computed: Option<&Computed>,
    input: &Input,
) -> Result<Source, Stop> {
    let no_unit =
        || Stop::new(format!("the unit of `{}` does not convert to that of the model", input.name));
    let keys = [Some(other.section), study.model.as_ref()].into_iter().flatten();
    let mut seeds = keys.filter_map(|section| section.common.seed.as_ref());
    if seeds.any(|name| name.as_str() == input.name) {
        return Ok(Source::Seed);
    }
    if let Some(k) = other.free.iter().position(|(name, _)| *name == input.name) {
        let factor = other.free[k].1.factor_to(&input.unit).ok_or_else(no_unit)?;
        return Ok(Source::Parameter(study.parameters.len() + k, factor));
    }
    if let Some(computed) = computed
        && let Some(k) = computed.names.iter().position(|name| name == &input.name)
    {
        let factor = computed.units[k].factor_to(&input.unit).ok_or_else(no_unit)?;
        return Ok(Source::Computed(k, factor));
    }
    let mut unknowns = study.unknowns.iter();
    if let Some(i) = unknowns.position(|u| u.name == input.name && u.acts_in(scenario)) {
        let factor = study.parameters[i].unit.factor_to(&input.unit).ok_or_else(no_unit)?;
        return Ok(Source::Parameter(i, factor));
    }
    if let Some(condition) = study.scenarios[scenario].value(&input.name) {
        let unit = condition.unit.as_ref().unwrap_or(&input.unit);
        let value = unit.convert(condition.value, &input.unit).ok_or_else(no_unit)?;
        return Ok(Source::Fixed(value));
    }
    let of_study = || study.model.as_ref()?.common.fixed.get(&input.name);
    if let Some(quantity) = other.section.common.fixed.get(&input.name).or_else(of_study) {
        return quantity.in_unit(&input.unit).map(Source::Fixed).ok_or_else(no_unit);
    }
    let default = input.default.map(Source::Fixed);
    default.ok_or_else(|| Stop::new(format!("nothing sets the input `{}`", input.name)))
}

//! Populations of unknowns by group besides the parameters: those of the discrepancy and of effects.
//!
//! The plugin names these unknowns, `variance[T24]` or `damping[T24].rate`, and gives all of them one prior, which becomes that of
//! the population's location. The two unknowns of each population follow those of the discrepancy.

use lacuna::data::{Form, Population, Unit};
use lacuna::plugin::Hyperparameter;
use lacuna::run::Stop;
use lacuna::text::nearest::{nearest, one_of};

use super::{PopulationKeys, ScatterKeys};
use crate::study::components::effect_name;
use crate::study::plain::Study;

/// A population as the study states it.
pub struct Pool<'s> {
    /// Section that states it, as in messages.
    section: String,
    /// Names of the members before and after the group in brackets: `damping` and `.rate`.
    parts: (String, String),
    keys: &'s ScatterKeys,
}

impl Study {
    /// True if unknowns of any kind have populations.
    pub fn has_populations(&self) -> bool {
        !self.dependence.populations.is_empty() || !self.pools().is_empty()
    }

    /// The populations of the discrepancy's unknowns, then those of effects.
    pub fn pools(&self) -> Vec<Pool<'_>> {
        let own = self.discrepancy.iter().flat_map(|section| &section.common.population);
        let own = own.map(|(name, keys)| Pool {
            section: "`[discrepancy]`".to_owned(),
            parts: (name.clone(), String::new()),
            keys,
        });
        let of_effects = self.effects.iter().flat_map(|section| {
            let effect = effect_name(section);
            section.common.population.iter().map(move |(name, keys)| Pool {
                section: format!("the effect `{effect}`"),
                parts: (effect.to_owned(), format!(".{name}")),
                keys,
            })
        });
        own.chain(of_effects).collect()
    }
}

impl Pool<'_> {
    /// Name of the unknown without its groups.
    fn name(&self) -> String {
        format!("{}{}", self.parts.0, self.parts.1)
    }

    /// The group in the name of a member; `None` for other names.
    fn group<'n>(&self, name: &'n str) -> Option<&'n str> {
        let (before, after) = &self.parts;
        name.strip_prefix(before.as_str())?
            .strip_suffix(after.as_str())?
            .strip_prefix('[')?
            .strip_suffix(']')
    }

    /// Places and groups of the members among some unknowns.
    fn members<'n>(&self, all: &'n [Hyperparameter]) -> Vec<(usize, &'n str)> {
        let member = |(i, own): (usize, &'n Hyperparameter)| Some((i, self.group(&own.name)?));
        all.iter().enumerate().filter_map(member).collect()
    }

    /// The population of some members, which all have the prior of its location.
    fn keys(&self, members: &[(usize, &str)], all: &[Hyperparameter]) -> Option<PopulationKeys> {
        members.first().map(|(first, _)| self.keys.around(&all[*first].prior))
    }

    /// Location and scale. Fails if there are no members in at least two groups, or if their prior is none of this location.
    fn unknowns(&self, all: &[Hyperparameter]) -> Result<[Hyperparameter; 2], Stop> {
        let members = self.members(all);
        let keys = self.keys(&members, all).filter(|_| members.len() > 1);
        let Some(keys) = keys else { return Err(self.without_members(all)) };
        let first = &all[members[0].0];
        self.fits(&members, all)?;
        let relative = keys.form() == Form::LogNormal;
        let linear = |x: f64| if relative { x.ln() } else { x };
        let starts = members.iter().map(|(i, _)| linear(all[*i].start));
        let mean = starts.sum::<f64>() / members.len() as f64;
        let middle = if relative { mean.exp() } else { mean };
        let [(location, of_location), (scale, of_scale)] = keys.unknowns();
        let named = |key: &str| format!("{}.{key}", self.name());
        let inside = of_location.log_density(middle).is_finite();
        Ok([
            Hyperparameter {
                name: named(location),
                symbol: named(location),
                unit: first.unit.clone(),
                prior: of_location.clone(),
                log: relative,
                start: if inside { middle } else { of_location.quantile(0.5) },
            },
            Hyperparameter {
                name: named(scale),
                symbol: named(scale),
                unit: if relative { Unit::dimensionless() } else { first.unit.clone() },
                prior: of_scale.clone(),
                // It is sampled as its logarithm with the members.
                log: false,
                start: of_scale.quantile(0.5),
            },
        ])
    }

    /// Fails if the prior of the members is none of the location of such a population, or if they have several.
    fn fits(&self, members: &[(usize, &str)], all: &[Hyperparameter]) -> Result<(), Stop> {
        let (name, section) = (self.name(), &self.section);
        let first = &all[members[0].0];
        if members.iter().any(|(i, _)| all[*i].prior != first.prior) {
            let text = format!("the groups of `{name}` of {section} have different priors");
            return Err(Stop::new(text).help("a population needs one prior, that of its location"));
        }
        let above_zero = first.prior.support().0 >= 0.0;
        let relative = self.keys.name() == "log_normal";
        if above_zero == relative {
            return Ok(());
        }
        let (is, name_of) =
            if above_zero { ("above zero", "log_normal") } else { ("of either sign", "normal") };
        let text = format!(
            "`{name}` of {section} is {is}, and the members of its {} population are not",
            self.keys.name()
        );
        let scatter = "{ sd = { half_normal = … } }";
        Err(Stop::new(text).help(format!("use `{name_of} = {scatter}`")))
    }

    fn without_members(&self, all: &[Hyperparameter]) -> Stop {
        let (name, section) = (self.name(), &self.section);
        let mut known: Vec<&str> = all.iter().map(|own| own.name.as_str()).collect();
        known.sort_unstable();
        if known.iter().any(|own| *own == name || self.group(own).is_some()) {
            let text =
                format!("`{name}` of {section} has a population, but not two groups with data");
            return Stop::new(text)
                .help("add `by`: the label of the scenarios, or the axis, that makes the groups");
        }
        let bases: Vec<&str> =
            known.iter().map(|own| own.split('[').next().unwrap_or(own)).collect();
        let stop = Stop::new(format!(
            "`population` of {section} names `{name}`, which is none of its unknowns"
        ));
        match nearest(&name, bases.iter().copied()) {
            Some(near) => stop.help(format!("did you mean `{near}`?")),
            None => stop.help(format!("expected {}", one_of(known))),
        }
    }
}

/// Unknowns of the populations, behind all others: location and scale of each.
pub fn unknowns(pools: &[Pool<'_>], all: &[Hyperparameter]) -> Result<Vec<Hyperparameter>, Stop> {
    let each: Vec<_> = pools.iter().map(|pool| pool.unknowns(all)).collect::<Result<_, _>>()?;
    Ok(each.into_iter().flatten().collect())
}

/// The populations by the places of their unknowns among all, and what makes these unknowns members: their prior describes
/// their distribution by itself, and their coordinate is that of a member.
pub fn populations(pools: &[Pool<'_>], all: &mut [Hyperparameter]) -> Vec<Population> {
    let mut found = Vec::new();
    for pool in pools {
        let name = pool.name();
        let members = pool.members(all);
        let Some(keys) = pool.keys(&members, all) else { continue };
        let [(location, _), (scale, of_scale)] = keys.unknowns();
        let place = |key: &str| all.iter().position(|own| own.name == format!("{name}.{key}"));
        let (Some(location), Some(scale)) = (place(location), place(scale)) else { continue };
        let population = Population {
            form: keys.form(),
            members: members.iter().map(|(i, _)| *i).collect(),
            groups: members.iter().map(|(_, group)| format!("{name}: {group}")).collect(),
            name,
            location,
            scale,
            typical: of_scale.quantile(0.5),
            centred: None,
        };
        let marginal = keys.marginal();
        for &member in &population.members {
            all[member].prior = marginal.clone();
            all[member].log = false;
        }
        found.push(population);
    }
    found
}

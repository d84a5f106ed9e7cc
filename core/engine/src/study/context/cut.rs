//! Parameters that the data do not update.

use lacuna::text::Complaints;
use lacuna::text::values::Count;

use crate::study::Study;

/// Fewest values of the cut parameters.
const FEWEST: usize = 10;

impl Study {
    /// Places of the parameters that the data do not update.
    pub fn cut(&self) -> Vec<usize> {
        let cut = self.unknowns.iter().enumerate().filter(|(_, unknown)| unknown.cut);
        cut.map(|(place, _)| place).collect()
    }
}

/// Reports cuts without data, of parameters on which the priors of others depend, and beside what has no
/// meaning for a cut distribution.
pub(super) fn check(study: &Study, complaints: &mut Complaints<'_>) {
    let cut = study.cut();
    let Some(&first) = cut.first() else {
        let section = study.sampler.as_ref();
        if section.is_some_and(|section| section.common.imputations.is_some()) {
            complaints
                .at("sampler.imputations")
                .say("no parameter is cut, so that there is nothing to impute")
                .expected("`cut = true` in a `[[parameter]]`, or no `imputations`");
        }
        return;
    };
    let path = |place: usize| format!("parameter.{}.cut", study.unknowns[place].name);
    if study.measurements.is_none() {
        complaints
            .at(&path(first))
            .say("the study has no measurements that could update a parameter")
            .expected("no `cut`, or `[measurements]`");
        return;
    }
    let dependence = &study.dependence;
    for group in &dependence.groups {
        let free = group.members.iter().find(|member| !cut.contains(member));
        let Some(&own) = group.members.iter().find(|member| cut.contains(member)) else { continue };
        if let Some(&free) = free {
            let name = &study.parameters[free].name;
            complaints
                .at(&path(own))
                .say(format!(
                    "the prior of `{}` depends on that of `{name}`, which is not cut",
                    study.parameters[own].name
                ))
                .expected("`cut` for both of them, or for neither");
        }
    }
    let free_groups = dependence.groups.iter().any(|group| !cut.contains(&group.members[0]));
    let others = [
        (!dependence.constraints.is_empty(), "a `[[constraint]]`"),
        (study.has_populations(), "populations"),
        (free_groups, "parameters that depend on each other and are not cut"),
        (!study.reliability.is_empty(), "`[[reliability]]`"),
    ];
    for (_, what) in others.iter().filter(|(present, _)| *present) {
        complaints
            .at(&path(first))
            .say(format!("`cut` cannot be combined with {what}"))
            .expected("one of the two");
    }
    let imputations = study.sampler.as_ref().and_then(|section| section.common.imputations);
    let imputations = imputations.map(Count::get);
    if let Some(count) = imputations.filter(|count| *count < FEWEST) {
        complaints
            .at("sampler.imputations")
            .say("too few values of the cut parameters to see how the others depend on them")
            .expected(format!("at least {FEWEST}"))
            .found(count);
    }
}

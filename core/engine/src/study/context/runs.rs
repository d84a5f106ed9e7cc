//! Consistency of `[[gap.runs]]` with the rest of the study.

use lacuna::text::nearest::one_of;
use lacuna::text::values::Name;
use lacuna::text::{Complaints, Node, Problems};

use crate::study::Study;

/// Reports tables that a study without an emulator cannot use, sizes that are parameters, and priors without the size of
/// absence; `gap` is the section.
pub(super) fn check(study: &Study, gap: &Node, problems: &mut Problems) {
    let named = |name: &Name| study.gap.runs.iter().any(|section| section.common.name == *name);
    for name in study.gap.keys.add.iter().filter(|name| !named(name)) {
        let tables = study.gap.runs.iter().map(|section| section.common.name.as_str());
        Complaints::new(gap, problems)
            .at("add")
            .say(format!("there is no table `{name}` of `[[gap.runs]]` to add"))
            .expected(one_of(tables));
    }
    let nodes = gap.get("runs").map(Node::elements).unwrap_or_default();
    for (i, (section, node)) in study.gap.runs.iter().zip(nodes).enumerate() {
        problems.within("runs", |problems| {
            let keys = &section.common;
            let mut complaints = Complaints::new(node, problems);
            if study.surrogate.is_none() {
                complaints
                    .at("")
                    .say("a further table of runs is compared with the emulator of the study's own runs, and the study has no `[surrogate]`")
                    .help("add `[surrogate]`, or take `[[gap.runs]]` out");
            }
            if study.gap.runs[..i].iter().any(|other| other.common.name == keys.name) {
                complaints
                    .at("name")
                    .say(format!("there are two tables `{}`", keys.name))
                    .help("give each `[[gap.runs]]` its own name");
            }
            if let Some(size) = &keys.size
                && study.parameters.iter().any(|parameter| parameter.name == size.as_str())
            {
                complaints
                    .at("size")
                    .say(format!("`{size}` is a parameter of the study"))
                    .expected("the name of a further column of the table");
            }
            let (low, high) = keys.prior.support();
            if keys.absent < low || keys.absent > high {
                complaints
                    .at("prior")
                    .say("the prior leaves out the size at which the physics is absent")
                    .expected(format!("a prior that reaches {} {}", keys.absent, keys.unit).trim_end())
                    .found(format!("[{low}, {high}]"));
            }
        });
    }
}

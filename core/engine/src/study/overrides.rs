//! `--set sampler.steps=200`: keys of a study set on the command line; `key+=value` adds to a list.

use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::node::{Key, Node, Value};
use lacuna::text::problem::Problems;
use lacuna::text::source::{Place, SourceId, Sources};

use super::inherit::{CommonKeys, Merge};

/// Applies every `path=value` in order; elements of a list are addressed by their `name`.
///
/// A `use` is set before other keys, so that the order of the arguments does not matter: a change of the plugin drops
/// the options of the old plugin, never those of the new one.
pub fn apply(
    study: &mut Node,
    arguments: &[String],
    common: CommonKeys<'_>,
    sources: &mut Sources,
    problems: &mut Problems,
) {
    let parsed = arguments.iter().filter_map(|text| Assignment::parse(text, sources, problems));
    let (plugins, keys): (Vec<_>, Vec<_>) =
        parsed.collect::<Vec<_>>().into_iter().partition(Assignment::chooses_plugin);
    let merge = Merge { common, sources };
    for assignment in plugins.into_iter().chain(keys) {
        assignment.apply(study, &merge, problems);
    }
}

/// One argument, parsed.
struct Assignment {
    path: Vec<Key>,
    value: Node,
    /// True if the value is added to a list.
    adds: bool,
}

impl Assignment {
    fn parse(text: &str, sources: &mut Sources, problems: &mut Problems) -> Option<Self> {
        let source = sources.add_argument("--set", text.to_owned());
        let whole = Place { source, span: 0..text.len() };
        let Some(equals) = outside_quotes(text, '=').next() else {
            problems
                .report(Some(whole), "an argument of `--set` has no `=`")
                .expected("`path=value`, such as `sampler.steps=200`");
            return None;
        };
        let adds = text[..equals].ends_with('+');
        let path = path(&text[..equals - usize::from(adds)], source);
        if path.iter().any(|key| key.name.is_empty()) {
            let place = Place { source, span: 0..equals.max(1) };
            problems
                .report(Some(place), "the path of a `--set` has an empty step")
                .expected("keys joined by `.`, such as `sampler.steps`");
            return None;
        }
        let value = text::value(text, equals + 1..text.len(), source, problems)?;
        Some(Self { path, value, adds })
    }

    fn chooses_plugin(&self) -> bool {
        self.path.last().is_some_and(|key| key.name == "use")
    }

    fn apply(self, study: &mut Node, merge: &Merge<'_>, problems: &mut Problems) {
        let chooses_plugin = self.chooses_plugin();
        let Self { mut path, value, adds } = self;
        let Some(last) = path.pop() else { return };
        let mut node = study;
        for (i, key) in path.iter().enumerate() {
            let inner = i > 0 && matches!(node.value, Value::Table(_));
            let Some(next) = descend(node, key, &path[..i], problems) else { return };
            node = next;
            // A problem with a table inside a section is reported at the key that was set in it.
            if inner && matches!(node.value, Value::Table(_)) {
                node.place = key.place.clone();
            }
        }
        if !matches!(node.value, Value::Table(_)) {
            let message = format!("`{}` has no keys to set", joined(&path));
            problems.report(Some(last.place), message).found(node.describe());
            return;
        }
        if chooses_plugin && node.get("use").is_some_and(|old| old.as_str() != value.as_str()) {
            let section = if path.len() == 1 { path[0].name.as_str() } else { "" };
            merge.drop_options(section, node);
        }
        if adds { append(node, last, value, problems) } else { node.set(last, value) }
    }
}

/// Adds a value to the list under `key`; creates the list if there is none.
fn append(table: &mut Node, key: Key, value: Node, problems: &mut Problems) {
    match table.get_mut(&key.name) {
        None => {
            let list = Node { place: value.place.clone(), value: Value::Array(vec![value]) };
            table.set(key, list);
        }
        Some(Node { value: Value::Array(elements), .. }) => elements.push(value),
        Some(other) => {
            let message = format!("`{}` is no list to which something could be added", key.name);
            let found = other.describe();
            problems.report(Some(key.place), message).found(found);
        }
    }
}

/// The table or named element under `key`; creates the table if there is none.
fn descend<'n>(
    node: &'n mut Node,
    key: &Key,
    before: &[Key],
    problems: &mut Problems,
) -> Option<&'n mut Node> {
    let described = node.describe();
    match &mut node.value {
        Value::Table(entries) => {
            let at = entries.iter().position(|(k, _)| k.name == key.name);
            let at = at.unwrap_or_else(|| {
                entries.push((key.clone(), Node::table(key.place.clone())));
                entries.len() - 1
            });
            Some(&mut entries[at].1)
        }
        Value::Array(elements) => {
            let names: Vec<String> =
                elements.iter().filter_map(Node::name).map(str::to_owned).collect();
            let found = elements.iter_mut().find(|element| element.name() == Some(&key.name));
            if found.is_none() {
                let list = joined(before);
                let message = format!("there is no `{list}` with the name `{}`", key.name);
                let names = || names.iter().map(String::as_str);
                let problem = problems.report(Some(key.place.clone()), message);
                problem.expected(one_of(names()));
                if let Some(near) = nearest(&key.name, names()) {
                    problem.help(format!("did you mean `{near}`?"));
                }
            }
            found
        }
        _ => {
            let message = format!("`{}` has no keys to set", joined(before));
            problems.report(Some(key.place.clone()), message).found(described);
            None
        }
    }
}

fn joined(path: &[Key]) -> String {
    path.iter().map(|key| key.name.as_str()).collect::<Vec<_>>().join(".")
}

/// The keys of a dotted path; a key in quotes may contain dots.
fn path(text: &str, source: SourceId) -> Vec<Key> {
    let mut ends: Vec<usize> = outside_quotes(text, '.').collect();
    ends.push(text.len());
    let mut start = 0;
    let mut keys = Vec::with_capacity(ends.len());
    for end in ends {
        let step = &text[start..end];
        let trimmed = step.trim();
        let from = start + (step.len() - step.trim_start().len());
        let name = trimmed.trim_matches(|c| c == '"' || c == '\'').to_owned();
        let place = Place { source, span: from..from + trimmed.len() };
        keys.push(Key { name, place });
        start = end + 1;
    }
    keys
}

/// Offsets of `wanted` outside quotes.
fn outside_quotes(text: &str, wanted: char) -> impl Iterator<Item = usize> {
    let mut quote = None;
    text.char_indices().filter_map(move |(at, c)| {
        match quote {
            Some(open) if c == open => quote = None,
            None if c == '"' || c == '\'' => quote = Some(c),
            None if c == wanted => return Some(at),
            _ => {}
        }
        None
    })
}

mod text;

#[cfg(test)]
mod tests;

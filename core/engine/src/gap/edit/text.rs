//! Text of an edited study: its file with few lines changed.

use std::path::Path;

use lacuna::text::emit::{Unwritable, key, to_line, to_table, to_toml};
use lacuna::text::node::Node;
use lacuna::text::{Problems, Sources, node, read};
use toml::{Table, Value};

use super::Edit;
use super::swap::swapped;
use crate::study::Study;
use crate::study::resolve::load_text;

impl Edit {
    /// The study after the changes: its own text with its comments if that alone defines the same study, otherwise the
    /// complete study with its defaults. `why` is placed above the new parameters as comments.
    pub fn text(&self, study: &Study, why: &str) -> Result<String, Unwritable> {
        let whole = self.applied(&study.resolved)?;
        let comments: String = why.lines().map(|line| format!("# {line}\n")).collect();
        match self.of_own_text(study, &whole, &comments) {
            Some(text) => Ok(text),
            None => Ok(format!("{comments}\n{}", to_toml(&whole)?)),
        }
    }

    /// The changed text of the study; `None` if it would define another study than `whole`.
    fn of_own_text(&self, study: &Study, whole: &Table, comments: &str) -> Option<String> {
        let mut text = study.text.clone();
        if let Some(swap) = &self.swapped {
            text = swapped(&text, swap, comments)?;
        }
        for change in &self.model {
            text = set(&text, &change.path, &change.value)?;
        }
        for name in &self.freed {
            text = unset(&text, &["fixed".to_owned(), name.clone()])?;
            text = untried(&text, name)?;
        }
        if !text.ends_with('\n') {
            text.push('\n');
        }
        for (i, added) in self.parameters.iter().enumerate() {
            let above = if i == 0 && self.swapped.is_none() { comments } else { "" };
            let parameter = Table::from_iter([(
                "parameter".to_owned(),
                Value::Array(vec![to_table(added).ok()?.into()]),
            )]);
            text = format!("{text}\n{above}{}", to_toml(&parameter).ok()?);
        }
        // The result is compared with the edit, because the text can be written in forms that the rewriting does not
        // cover.
        let path = study.directory.join(format!("{}.toml", study.name));
        let again = resolved(&path, &text)?;
        (same(&again, whole)).then_some(text)
    }
}

fn resolved(path: &Path, text: &str) -> Option<Table> {
    load_text(path, text, &[]).study.map(|study| study.resolved)
}

/// Returns true if two studies are equal after all defaults are filled in; a new parameter has defaults of its own, and
/// so has another model.
fn same(a: &Table, b: &Table) -> bool {
    let bare = |table: &Table| {
        let mut bare = table.clone();
        if let Some(Value::Array(parameters)) = bare.get_mut("parameter") {
            for parameter in parameters.iter_mut().filter_map(Value::as_table_mut) {
                parameter.remove("design");
                parameter.remove("symbol");
            }
        }
        if let Some(Value::Table(model)) = bare.get_mut("model")
            && model.get("fixed").and_then(Value::as_table).is_some_and(Table::is_empty)
        {
            model.remove("fixed");
        }
        bare
    };
    bare(a) == bare(b)
}

/// A text with its syntax tree.
struct Written<'t> {
    text: &'t str,
    root: Node,
}

impl<'t> Written<'t> {
    fn of(text: &'t str) -> Option<Self> {
        let (mut sources, mut problems) = (Sources::default(), Problems::new());
        let source = sources.add_argument("study", text.to_owned());
        read::read(source, &sources, &mut problems).map(|root| Self { text, root })
    }

    fn in_braces(&self, node: &Node) -> bool {
        self.text[node.place.span.clone()].starts_with('{')
    }

    /// The text with a value in braces replaced by the output of `change`.
    fn rewritten(&self, node: &Node, change: impl FnOnce(&mut Table)) -> Option<String> {
        let span = node.place.span.clone();
        let Value::Table(mut table) = Value::try_from(node).ok()? else { return None };
        change(&mut table);
        Some(self.spliced(span, &to_line(&table).ok()?))
    }

    fn spliced(&self, span: std::ops::Range<usize>, with: &str) -> String {
        format!("{}{with}{}", &self.text[..span.start], &self.text[span.end..])
    }
}

/// The text with an option of `[model]` set.
fn set(text: &str, path: &[String], value: &Value) -> Option<String> {
    let written = Written::of(text)?;
    let mut node = written.root.get("model")?;
    for (i, step) in path.iter().enumerate() {
        let rest = &path[i..];
        if written.in_braces(node) {
            let change =
                lacuna::plugin::amend::Change { path: rest.to_vec(), value: value.clone() };
            return written.rewritten(node, |table| {
                *table = lacuna::plugin::amend::changed(table, &[change]);
            });
        }
        match node.get(step) {
            Some(next) if rest.len() == 1 => {
                return Some(written.spliced(next.place.span.clone(), &to_line(value).ok()?));
            }
            Some(next) => node = next,
            None => {
                // The option is written on a line of its own below the header.
                let line = nested(rest, value);
                let below = text[node.place.span.end..]
                    .find('\n')
                    .map(|at| node.place.span.end + at + 1)?;
                let line = format!("{} = {}\n", key(step), to_line(&line).ok()?);
                return Some(written.spliced(below..below, &line));
            }
        }
    }
    None
}

/// The value nested under all keys but the first.
fn nested(path: &[String], value: &Value) -> Value {
    path[1..]
        .iter()
        .rev()
        .fold(value.clone(), |inner, key| Table::from_iter([(key.clone(), inner)]).into())
}

/// The text without an option of `[model]`; unchanged if the option is not written.
fn unset(text: &str, path: &[String]) -> Option<String> {
    let written = Written::of(text)?;
    let Some(mut node) = written.root.get("model") else { return Some(text.to_owned()) };
    for (i, step) in path.iter().enumerate() {
        if written.in_braces(node) {
            let rest = &path[i..];
            return written.rewritten(node, |table| remove(table, rest));
        }
        let entry: Option<&(node::Key, Node)> =
            node.entries().iter().find(|(k, _)| &k.name == step);
        let Some((name, next)) = entry else { return Some(text.to_owned()) };
        if i + 1 == path.len() {
            let begin = text[..name.place.span.start].rfind('\n').map_or(0, |at| at + 1);
            let end = next.place.span.end;
            let end = text[end..].find('\n').map_or(text.len(), |at| end + at + 1);
            return Some(written.spliced(begin..end, ""));
        }
        node = next;
    }
    None
}

/// The text without the entries of `[gap]` for an input that is no longer a candidate.
fn untried(text: &str, name: &str) -> Option<String> {
    let written = Written::of(text)?;
    let of = |path: &str| written.root.find(path).map(Node::elements).unwrap_or_default();
    let called = |node: &&Node, key: &str| node.get(key).and_then(Node::as_str) == Some(name);
    let switch = of("gap.switch").iter().find(|node| called(node, "input"));
    let term = of("gap.term")
        .iter()
        .find(|node| called(node, "name") || (node.name().is_none() && called(node, "use")));
    let Some(node) = switch.or(term) else { return Some(text.to_owned()) };
    let begin = node.place.span.start;
    if !text[begin..].starts_with("[[") {
        return None;
    }
    let end = text[begin + 2..].find("\n[").map_or(text.len(), |at| begin + 2 + at + 1);
    Some(written.spliced(begin..end, ""))
}

fn remove(table: &mut Table, path: &[String]) {
    match path {
        [last] => {
            table.remove(last);
        }
        [first, rest @ ..] => {
            if let Some(Value::Table(inner)) = table.get_mut(first) {
                remove(inner, rest);
            }
        }
        [] => {}
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    const STUDY: &str = "[model] # of mine\nuse = \"equations\" # keep\nfixed = { drag = 0.0, mass = 2.0 }\n\n\
                         [model.rate] # the rates\nx = \"v\" # kinematics\nv = \"-x\"\n\n[design]\nruns = 4\n";

    fn path(keys: &[&str]) -> Vec<String> {
        keys.iter().map(|key| (*key).to_owned()).collect()
    }

    #[test]
    fn one_line_changes_and_comments_stay() {
        let text = set(STUDY, &path(&["rate", "v"]), &"-x + c * v".into()).unwrap();
        assert_eq!(text, STUDY.replace("v = \"-x\"", "v = \"-x + c * v\""));
        let text = set(STUDY, &path(&["rate", "z"]), &"x - z".into()).unwrap();
        assert_eq!(text, STUDY.replace("# the rates\n", "# the rates\nz = \"x - z\"\n"));
        let text = set(STUDY, &path(&["state", "z"]), &1.5.into()).unwrap();
        assert_eq!(text, STUDY.replace("# of mine\n", "# of mine\nstate = { z = 1.5 }\n"));
    }

    #[test]
    fn what_is_found_is_tried_no_longer() {
        let switch = "[[gap.switch]]\ninput = \"drag\"\nprior = { half_normal = 1 }\n\n";
        let term = "[[gap.term]]\nuse = \"pull\"\nstate = \"v\"\n";
        let text = [STUDY, switch, term].concat();
        assert_eq!(untried(&text, "drag").unwrap(), [STUDY, term].concat());
        assert_eq!(untried(&text, "pull").unwrap(), [STUDY, switch].concat());
        assert_eq!(untried(&text, "mass").unwrap(), text);
    }

    #[test]
    fn what_is_freed_is_fixed_no_longer() {
        let text = unset(STUDY, &path(&["fixed", "drag"])).unwrap();
        assert_eq!(text, STUDY.replace("drag = 0.0, ", ""));
        let headed = "[model]\n[model.fixed]\ndrag = 0.0 # none\nmass = 2.0\n";
        let text = unset(headed, &path(&["fixed", "drag"])).unwrap();
        assert_eq!(text, "[model]\n[model.fixed]\nmass = 2.0\n");
        assert_eq!(unset(headed, &path(&["fixed", "depth"])).unwrap(), headed);
    }
}

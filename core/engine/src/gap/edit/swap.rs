//! The text of a study with another model in place of its own.

use std::ops::Range;

use lacuna::text::emit::to_toml;
use lacuna::text::node::Node;
use lacuna::text::{Problems, Sources, read};
use toml::{Table, Value};

use super::Swapped;

/// The text with the new model and `above` as comments over it; `None` if the study is not written in sections.
pub(super) fn swapped(text: &str, swap: &Swapped, above: &str) -> Option<String> {
    let mut text = text.to_owned();
    let parameters = |root: &Node| {
        let idle = |node: &&Node| {
            node.get("name").and_then(Node::as_str).is_some_and(|name| is_in(&swap.idle, name))
        };
        begins(root.find("parameter").map(Node::elements).unwrap_or_default().iter().filter(idle))
    };
    let own = |root: &Node| {
        let other = |node: &&Node| node.get("name").and_then(Node::as_str) == Some(&swap.name);
        let of = |list: &str| root.find(list).map(Node::elements).unwrap_or_default().iter();
        let models = of("gap.model").filter(other);
        begins(of("gap.switch").chain(of("gap.term")).chain(models))
    };
    for what in [&parameters as &dyn Fn(&Node) -> Vec<usize>, &own] {
        for begin in what(&tree(&text)?).into_iter().rev() {
            let range = section(&text, begin)?;
            text.replace_range(range, "");
        }
    }
    let root = tree(&text)?;
    let range = section(&text, root.get("model")?.place.span.start)?;
    let model = Table::from_iter([("model".to_owned(), Value::Table(swap.model.clone()))]);
    let model = to_toml(&model).ok()?;
    text.replace_range(range, &format!("{above}{}\n", model.trim_start()));
    Some(text)
}

fn is_in(names: &[String], name: &str) -> bool {
    names.iter().any(|other| other == name)
}

/// Offsets of the headers of sections, in the order of the text.
fn begins<'n>(nodes: impl Iterator<Item = &'n Node>) -> Vec<usize> {
    let mut all: Vec<usize> = nodes.map(|node| node.place.span.start).collect();
    all.sort_unstable();
    all
}

fn tree(text: &str) -> Option<Node> {
    let (mut sources, mut problems) = (Sources::default(), Problems::new());
    let source = sources.add_argument("study", text.to_owned());
    read::read(source, &sources, &mut problems)
}

/// The lines of the section whose header begins at `begin`, with those of its subsections; comments above the next
/// section belong to that one.
fn section(text: &str, begin: usize) -> Option<Range<usize>> {
    let own = header(&text[begin..])?;
    let below = format!("{own}.");
    let mut end = text.len();
    let mut at = begin + text[begin..].find('\n').map_or(text.len() - begin, |line| line + 1);
    let mut last = at;
    while at < text.len() {
        let line = text[at..].lines().next().unwrap_or_default();
        let next = at + text[at..].find('\n').map_or(text.len() - at, |line| line + 1);
        match header(line) {
            Some(name) if !name.starts_with(&below) => {
                end = last;
                break;
            }
            _ if line.trim().is_empty() || line.trim_start().starts_with('#') => {}
            _ => last = next,
        }
        at = next;
    }
    // Blank lines between this section and the next are removed with it.
    let blank = text[end..].len() - text[end..].trim_start_matches('\n').len();
    Some(begin..end + blank)
}

/// The name in a header; `None` if the line is no header.
fn header(line: &str) -> Option<&str> {
    let inner = line.strip_prefix("[[").or_else(|| line.strip_prefix('['))?;
    inner.split(']').next().map(str::trim)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    const STUDY: &str = "[study]\ntitle = \"mine\"\n\n[[parameter]]\nname = \"drag\"\nprior = { normal = [0, 1] }\n\n\
                         # heavy\n[[parameter]]\nname = \"mass\"\nprior = { normal = [1, 1] }\n\n\
                         [model] # simple\nuse = \"a\"\n\n[model.rate]\nx = \"v\"\n\n# what was seen\n[measurements]\nuse = \"csv\"\n\n\
                         [[gap.model]]\nname = \"other\"\nuse = \"b\"\n[gap.model.fixed]\nz = 1\n";

    #[test]
    fn the_model_is_another_and_all_else_stays() {
        let model = Table::from_iter([("use".to_owned(), "b".into())]);
        let swap = Swapped { name: "other".into(), model, idle: vec!["drag".into()] };
        let text = swapped(STUDY, &swap, "# better\n").unwrap();
        let drag = "[[parameter]]\nname = \"drag\"\nprior = { normal = [0, 1] }\n\n";
        let old = "[model] # simple\nuse = \"a\"\n\n[model.rate]\nx = \"v\"\n\n";
        let expected = STUDY.replace(drag, "").replace(old, "# better\n[model]\nuse = \"b\"\n\n");
        assert_eq!(text, expected.split("[[gap.model]]").next().unwrap());
    }
}

//! Definitions in a Python file, determined from its text without an interpreter.
//!
//! Only functions at the left margin and their arguments are found. A file that is not valid Python, or that defines
//! its functions in another way, is left to the interpreter, which `lacuna run` starts.

use std::collections::{BTreeMap, BTreeSet};

use super::check::{Arguments, Names};

/// Definitions found for the functions `wanted`.
pub fn names(text: &str, wanted: &[&str]) -> Names {
    let code = code(text);
    let mut functions = BTreeMap::new();
    let mut defined = Vec::new();
    let mut decorated = false;
    let mut start = 0;
    for line in code.split_inclusive('\n') {
        let rest = &code[start..];
        start += line.len();
        if let Some(name) = line.strip_prefix("def ").map(|after| word(after.trim_start())) {
            defined.push(name.to_owned());
            if wanted.contains(&name) {
                // A decorator may change the arguments of a function.
                let seen = if decorated { None } else { arguments(rest) };
                functions.insert(name.to_owned(), seen);
            }
        }
        let at_margin = line.starts_with(|c: char| !c.is_whitespace() && c != ')');
        decorated = if at_margin { line.starts_with('@') } else { decorated };
    }
    // Any other occurrence of the name may define a function.
    let words: BTreeSet<&str> = code.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
    let star = code.lines().any(|line| line.contains("import") && line.contains('*'));
    let missing = |name: &&&str| !star && !words.contains(**name);
    let unknown = wanted.iter().filter(missing).map(|name| (*name).to_owned()).collect();
    Names::Sound { functions, unknown, defined }
}

/// The identifier at the start of a text.
fn word(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    &text[..end]
}

/// The text with blanks in place of comments and of the contents of strings; its lines are the same.
fn code(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut open: Option<&str> = None;
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let mut taken = c.len_utf8();
        if let Some(quote) = open {
            let over = quote.len() == 1 && c == '\n';
            if c == '\\' {
                taken += rest[taken..].chars().next().map_or(0, char::len_utf8);
            } else if rest.starts_with(quote) {
                taken = quote.len();
                open = None;
            } else if over {
                open = None;
            }
            code.extend(rest[..taken].chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
        } else if let Some(quote) =
            ["\"\"\"", "'''", "\"", "'"].iter().find(|q| rest.starts_with(**q))
        {
            taken = quote.len();
            open = Some(quote);
            code.push_str(&" ".repeat(taken));
        } else if c == '#' {
            taken = rest.find('\n').unwrap_or(rest.len());
        } else {
            code.push(c);
        }
        rest = &rest[taken..];
    }
    code
}

/// The arguments of the function that begins here; `None` if its brackets do not close.
fn arguments(code: &str) -> Option<Arguments> {
    let inside = &code[code.find('(')? + 1..];
    let (mut parts, mut depth) = (vec![String::new()], 0_i32);
    let mut closed = false;
    for c in inside.chars() {
        match c {
            ')' if depth == 0 => {
                closed = true;
                break;
            }
            ',' if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
        if let Some(part) = parts.last_mut() {
            part.push(c);
        }
    }
    let mut found = Arguments { names: Vec::new(), optional: Vec::new(), any: false };
    for part in parts.iter().map(|part| part.trim()) {
        let name = word(part);
        if part.starts_with("**") {
            found.any = true;
        } else if part == "/" {
            // Arguments before the slash cannot be passed by name.
            found.names.clear();
            found.optional.clear();
        } else if !name.is_empty() {
            found.names.push(name.to_owned());
            if part.contains('=') {
                found.optional.push(name.to_owned());
            }
        }
    }
    closed.then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"
"""A model.

def commented(a, b):
"""
import numpy as np

def simulate(a, b: dict[str, float] = {"x, y": 1}, *, c=(1, 2),  # def hidden(
             layout, **rest) -> list:
    def inner(z):
        return '''def quoted(x):'''
    return [a, b]

@cached
@other(
    1,
)
def changed(x):
    return x

def only(a, /, b, *more):
    return a

made = np.vectorize(only)
"#;

    fn sound(wanted: &[&str]) -> (BTreeMap<String, Option<Arguments>>, Vec<String>, Vec<String>) {
        match names(FILE, wanted) {
            Names::Sound { functions, unknown, defined } => (functions, unknown, defined),
            Names::Wrong { .. } => panic!("the text is not judged"),
        }
    }

    #[test]
    fn functions_are_seen_with_their_arguments() {
        let (functions, unknown, defined) = sound(&["simulate", "changed", "only", "made"]);
        assert_eq!(defined, ["simulate", "changed", "only"]);
        assert!(unknown.is_empty());
        let simulate = functions["simulate"].as_ref().unwrap();
        assert_eq!(simulate.names, ["a", "b", "c", "layout"]);
        assert_eq!(simulate.optional, ["b", "c"]);
        assert!(simulate.any);
        assert!(functions["changed"].is_none());
        assert_eq!(functions["only"].as_ref().unwrap().names, ["b"]);
    }

    #[test]
    fn what_is_in_comments_and_strings_is_no_function() {
        for name in ["commented", "hidden", "quoted"] {
            assert_eq!(sound(&[name]).1, [name]);
        }
        assert_eq!(sound(&["inner"]).1, Vec::<String>::new());
    }
}

//! The plugins that the text of a file declares, found without running it.

use lacuna_abi::record::{Record, is_word};

/// Kinds that a file can hold.
const KINDS: [&str; 7] =
    ["model", "quantity", "effect", "discrepancy", "sampler", "surrogate", "reader"];

/// Kind and name of each plugin that the text declares by a decorator `@lacuna.KIND` before a class or by a call
/// `lacuna.KIND(Class, name="...")` at the beginning of a line; other ways to declare one are not seen.
pub fn record(text: &str) -> Record {
    let mut plugins = Vec::new();
    let mut waiting: Option<(&str, Option<String>)> = None;
    for line in text.lines() {
        if let Some((kind, rest)) = line.strip_prefix('@').and_then(declaration) {
            waiting = Some((kind, quoted(rest)));
        } else if let Some(class) = line.strip_prefix("class ") {
            if let Some((kind, named)) = waiting.take() {
                plugins.push((kind.to_owned(), named.unwrap_or_else(|| snake(class))));
            }
        } else if let Some((kind, rest)) = declaration(line) {
            let class = rest.trim_start_matches('(');
            plugins.push((kind.to_owned(), quoted(rest).unwrap_or_else(|| snake(class))));
        }
    }
    plugins.retain(|(_, name)| is_word(name));
    Record { abi: None, plugins }
}

/// The kind after `lacuna.`, and what follows it.
fn declaration(line: &str) -> Option<(&'static str, &str)> {
    let after = line.strip_prefix("lacuna.")?;
    KINDS.into_iter().find_map(|kind| {
        let rest = after.strip_prefix(kind)?;
        (rest.is_empty() || rest.starts_with(['(', ' '])).then_some((kind, rest))
    })
}

/// The first text in quotes.
fn quoted(text: &str) -> Option<String> {
    let start = text.find(['"', '\''])?;
    let quote = char::from(text.as_bytes()[start]);
    let inside = &text[start + 1..];
    Some(inside[..inside.find(quote)?].to_owned())
}

/// The name of a class as that of a plugin: `HeatLoss` is `heat_loss`.
fn snake(class: &str) -> String {
    let name: Vec<char> =
        class.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
    let mut snake = String::new();
    for (i, c) in name.iter().enumerate() {
        let after = i.checked_sub(1).map(|i| name[i]);
        let before_small = name.get(i + 1).is_some_and(char::is_ascii_lowercase);
        let begins = after.is_some_and(|a| {
            a.is_ascii_lowercase() || a.is_ascii_digit() || (a.is_ascii_uppercase() && before_small)
        });
        if c.is_ascii_uppercase() && begins {
            snake.push('_');
        }
        snake.push(c.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plugins_are_found_in_the_text() {
        let text = "import lacuna\n\n@lacuna.sampler\nclass RandomWalk:\n    pass\n\n\
                    @lacuna.effect(\"sag\")\nclass A:\n    pass\n\nclass NoPlugin:\n    pass\n\
                    lacuna.surrogate(RandomForestRegressor, name=\"forest\")\n\
                    lacuna.surrogate(GPRegressor)\n# lacuna.sampler is a decorator\n";
        let found: Vec<(String, String)> = record(text).plugins;
        let expected = [
            ("sampler", "random_walk"),
            ("effect", "sag"),
            ("surrogate", "forest"),
            ("surrogate", "gp_regressor"),
        ];
        assert_eq!(found, expected.map(|(kind, name)| (kind.to_owned(), name.to_owned())));
    }
}

//! Rendering of a manual page as plain text for a terminal and as Markdown for the book.

use std::fmt::Write as _;

use super::{Choice, Manual, OptionManual};

/// Target width of lines of plain text, in characters.
const WIDTH: usize = 90;

impl Manual {
    /// Renders the page for a terminal.
    pub fn plain(&self) -> String {
        let mut page = format!("{}\n\n", self.name);
        page.push_str(&wrap(&self.title, ""));
        for paragraph in paragraphs(&self.prose) {
            page.push('\n');
            page.push_str(&paragraph_plain(&paragraph, ""));
        }
        if !self.options.is_empty() {
            page.push_str("\noptions\n");
        }
        for option in &self.options {
            page.push('\n');
            page.push_str(&wrap(&format!("{}: {}", option.key, option.summary()), "  "));
            for paragraph in paragraphs(&option.text) {
                page.push_str(&paragraph_plain(&paragraph, "      "));
            }
            for choice in &option.choices {
                let text = first_line(&choice.text);
                let colon = if text.is_empty() { "" } else { ": " };
                page.push_str(&wrap(&format!("- {}{colon}{text}", choice.written), "      "));
            }
        }
        page
    }

    /// Renders the page for the book.
    pub fn markdown(&self) -> String {
        let mut page = format!("# `{}`\n\n{}\n", self.name, self.title);
        if !self.prose.is_empty() {
            let _ = writeln!(page, "\n{}", self.prose);
        }
        if self.options.is_empty() {
            return page;
        }
        page.push_str("\n| option | value | default | meaning |\n|---|---|---|---|\n");
        for (i, option) in self.options.iter().enumerate() {
            let default = match &option.default {
                Some(default) => format!("`{default}`"),
                None if option.required => "required".to_owned(),
                None => String::new(),
            };
            let mut meaning = vec![one_line(&option.text)];
            match self.options[..i].iter().find(|earlier| same_choices(earlier, option)) {
                Some(earlier) => {
                    meaning.push(format!("The choices are those of `{}`.", earlier.key));
                }
                None => meaning.extend(option.choices.iter().map(Choice::markdown)),
            }
            meaning.retain(|part| !part.is_empty());
            let cells = [format!("`{}`", option.key), option.kind.clone(), default];
            let cells = cells.map(|cell| cell.replace('|', "\\|")).join(" | ");
            let meaning = meaning.join("<br>").replace('|', "\\|");
            let _ = writeln!(page, "| {cells} | {meaning} |");
        }
        page
    }
}

/// Returns true if two options have the same long list of choices.
fn same_choices(a: &OptionManual, b: &OptionManual) -> bool {
    a.choices.len() > 3 && a.choices == b.choices
}

impl Choice {
    fn markdown(&self) -> String {
        let text = one_line(&self.text);
        let colon = if text.is_empty() { "" } else { ": " };
        let quote = if self.literal { "`" } else { "" };
        format!("• {quote}{}{quote}{colon}{text}", self.written)
    }
}

impl OptionManual {
    /// Type and default of the option, in one line.
    fn summary(&self) -> String {
        match &self.default {
            Some(default) => format!("{}, default {default}", self.kind),
            None if self.required => format!("{}, required", self.kind),
            None => self.kind.clone(),
        }
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn first_line(text: &str) -> String {
    one_line(text.split("\n\n").next().unwrap_or(""))
}

/// Splits text into paragraphs and code blocks; a code block may contain empty lines.
fn paragraphs(text: &str) -> Vec<String> {
    let mut list: Vec<String> = Vec::new();
    let mut current = String::new();
    let mut in_code = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        }
        if line.trim().is_empty() && !in_code {
            list.extend((!current.is_empty()).then(|| std::mem::take(&mut current)));
        } else {
            current.push_str(line);
            current.push('\n');
        }
    }
    list.extend((!current.is_empty()).then_some(current));
    list
}

/// Wraps a paragraph; code, lists and tables are kept line by line.
fn paragraph_plain(paragraph: &str, indent: &str) -> String {
    let kept = |line: &str| line.trim_start().starts_with(['-', '*', '|', '#', '`', ' ']);
    let as_is = paragraph.starts_with("```")
        || paragraph.starts_with("    ")
        || paragraph.lines().any(|line| line.starts_with(['-', '*', '|', '#']) && kept(line));
    if !as_is {
        return wrap(&one_line(paragraph), indent);
    }
    let lines = paragraph.lines().filter(|line| !line.trim_start().starts_with("```"));
    let code = paragraph.starts_with("```");
    let deeper = if code { "    " } else { "" };
    lines.fold(String::new(), |text, line| text + indent + deeper + line + "\n")
}

/// Wraps words to lines of limited width; lines after the first are indented further.
fn wrap(text: &str, indent: &str) -> String {
    let mut lines = String::new();
    let mut line = indent.to_owned();
    let hanging = if text.starts_with("- ") { "  " } else { "" };
    for word in text.split_whitespace() {
        let empty = line.trim().is_empty();
        if !empty && line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines.push_str(&line);
            lines.push('\n');
            line = format!("{indent}{hanging}{word}");
        } else {
            line.push_str(if empty { "" } else { " " });
            line.push_str(word);
        }
    }
    lines + &line + "\n"
}

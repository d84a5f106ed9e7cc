//! The subset of Markdown that the tests of the documentation need.

use std::fs;
use std::path::{Path, PathBuf};

/// A file of Markdown.
pub struct Page {
    pub path: PathBuf,
    text: String,
}

/// A fenced block.
pub struct Block {
    /// Number of the line of its first fence, from 1.
    pub line: usize,
    /// Text after the first fence.
    info: String,
    pub text: String,
}

impl Page {
    pub fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_default();
        Self { path: path.to_owned(), text }
    }

    /// All pages of the project, without build products and hidden folders.
    pub fn all(root: &Path) -> Vec<Self> {
        let mut pages = Vec::new();
        let mut folders = vec![root.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                if path.is_dir() && !name.starts_with('.') && name != "target" && name != "runs" {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "md") {
                    pages.push(Self::read(&path));
                }
            }
        }
        pages.sort_by(|a, b| a.path.cmp(&b.path));
        pages
    }

    /// The part below a heading of the second level.
    pub fn section(&self, heading: &str) -> Self {
        let lines = self.text.lines().skip_while(|line| line.strip_prefix("## ") != Some(heading));
        let part = lines.enumerate().take_while(|(i, line)| *i == 0 || !line.starts_with("## "));
        let text = part.map(|(_, line)| format!("{line}\n")).collect();
        Self { path: self.path.clone(), text }
    }

    /// Fenced blocks with this text after their first fence.
    pub fn blocks(&self, info: &str) -> Vec<Block> {
        let (mut blocks, mut open) = (Vec::new(), None::<Block>);
        for (number, line) in self.text.lines().enumerate() {
            match (line.strip_prefix("```"), &mut open) {
                (Some(info), None) => {
                    let info = info.trim().to_owned();
                    open = Some(Block { line: number + 1, info, text: String::new() });
                }
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (None, Some(block)) => block.text.push_str(&format!("{line}\n")),
                (None, None) => {}
            }
        }
        blocks.retain(|block| block.info == info);
        blocks
    }

    /// Lines outside fenced blocks, with code between backticks removed.
    fn prose(&self) -> Vec<String> {
        let mut inside = false;
        let outside = self.text.lines().filter(|line| {
            let fence = line.starts_with("```");
            inside ^= fence;
            !inside && !fence
        });
        outside.map(|line| line.split('`').step_by(2).collect()).collect()
    }

    /// Targets of relative links and pictures.
    pub fn links(&self) -> Vec<String> {
        let targets = |line: &String| -> Vec<String> {
            let after = line.split("](").skip(1);
            after.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
        };
        let mut links: Vec<String> = self.prose().iter().flat_map(targets).collect();
        links.retain(|link| !link.contains("://"));
        links
    }

    /// Anchors of the headings.
    pub fn anchors(&self) -> Vec<String> {
        let headings = self.text.lines().filter(|line| line.starts_with('#'));
        let anchor = |heading: &str| -> String {
            let words = heading.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        };
        headings.map(anchor).collect()
    }
}

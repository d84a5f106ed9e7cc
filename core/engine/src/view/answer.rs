//! From an address to its answer.

use std::fs::File;
use std::path::PathBuf;

use serde::Serialize;
use serde_json::json;

use super::address::{encoded, parts, values};
use super::folder::ServedFolder;
use super::pages;
use super::row::RunState;
use super::watched::SCHEMA;
use crate::compare::{Comparison, Finished, compare};

/// Answer to an address.
#[derive(Debug)]
pub enum Answer {
    /// A page, or a part of one.
    Page(String),
    /// JSON.
    Json(String),
    /// A file of a run.
    File {
        /// The file, opened.
        file: File,
        /// Length of the file, in bytes.
        length: u64,
        /// Media type of the file.
        kind: &'static str,
    },
    /// Another address.
    MovedTo(String),
    /// There is no answer: HTTP status and reason.
    Refused(u16, String),
}

impl ServedFolder {
    /// The answer to a path and a query, as they were sent.
    pub fn answer(&self, path: &str, query: &str) -> Answer {
        let Some(parts) = parts(path) else {
            return Answer::Refused(403, "this path leads out of the folder".to_owned());
        };
        let words: Vec<&str> = parts.iter().map(String::as_str).collect();
        match words[..] {
            [""] => match self.only() {
                Some(only) => Answer::MovedTo(format!("/runs/{}/", encoded(only))),
                None => Answer::Page(pages::list(self.root(), &self.rows())),
            },
            ["part", "runs"] => Answer::Page(pages::list_part(&self.rows())),
            ["api", "runs"] => in_json(&json!({ "schema": SCHEMA, "runs": self.rows() })),
            ["compare"] => self.comparison(query, |found| Answer::Page(pages::comparison(found))),
            ["api", "compare"] => self.comparison(query, in_json),
            ["runs", name] => match self.run(name) {
                Some(_) => Answer::MovedTo(format!("/runs/{}/", encoded(name))),
                None => no_run(name),
            },
            ["runs", name, ""] => self.of_run(name, |found| {
                Answer::Page(pages::run(
                    found,
                    self.only().is_none(),
                    self.assessment(name).as_ref(),
                ))
            }),
            ["part", "runs", name] => self.of_run(name, |found| {
                Answer::Page(pages::run_part(found, self.assessment(name).as_ref()))
            }),
            ["api", "runs", name] => self.of_run(name, in_json),
            ["runs", name, ..] => self.file_of_run(name, &parts[2..]),
            _ => Answer::Refused(404, format!("there is no `{path}` here")),
        }
    }

    fn of_run<'a>(
        &'a self,
        name: &str,
        answer: impl FnOnce(&super::Watched) -> Answer + 'a,
    ) -> Answer {
        self.watched(name).map_or_else(|| no_run(name), |found| answer(&found))
    }

    fn file_of_run(&self, name: &str, parts: &[String]) -> Answer {
        if self.run(name).is_none() {
            return no_run(name);
        }
        let kind = kind(parts.last().map_or("", String::as_str));
        match self.file(name, parts) {
            Some((file, length)) => Answer::File { file, length, kind },
            None => {
                Answer::Refused(404, format!("the run `{name}` has no file `{}`", parts.join("/")))
            }
        }
    }

    /// Compares the finished runs that a query names.
    fn comparison(&self, query: &str, answer: impl FnOnce(&Comparison) -> Answer) -> Answer {
        let names = values(query, "run").unwrap_or_default();
        if names.len() < 2 {
            let text = "name two runs or more, such as `?run=a&run=b`";
            return Answer::Refused(400, text.to_owned());
        }
        let mut runs = Vec::new();
        for name in names {
            let Some(directory) = self.run(&name) else { return no_run(&name) };
            let finished = self.watched(&name).is_some_and(|w| w.row.state == RunState::Finished);
            match Finished::read(&directory) {
                Ok(mut run) if finished => {
                    run.directory = PathBuf::from(name);
                    runs.push(run);
                }
                Ok(_) => return Answer::Refused(409, format!("the run `{name}` is not finished")),
                Err(stop) => return Answer::Refused(409, stop.to_string()),
            }
        }
        answer(&compare(&runs))
    }
}

fn no_run(name: &str) -> Answer {
    Answer::Refused(404, format!("there is no run `{name}` here"))
}

fn in_json(value: &impl Serialize) -> Answer {
    match serde_json::to_string(value) {
        Ok(text) => Answer::Json(text + "\n"),
        Err(error) => Answer::Refused(500, format!("the answer is no JSON: {error}")),
    }
}

/// Media type of a file by its extension. Browsers show what they know; the rest is saved.
fn kind(name: &str) -> &'static str {
    let extension = name.rfind('.').map_or("", |dot| &name[dot..]);
    match extension {
        ".html" => "text/html; charset=utf-8",
        ".svg" => "image/svg+xml",
        ".png" => "image/png",
        ".csv" => "text/csv; charset=utf-8",
        ".json" => "application/json",
        ".toml" | ".txt" | ".jsonl" | ".sha256" => "text/plain; charset=utf-8",
        ".nc" => "application/x-netcdf",
        _ => "application/octet-stream",
    }
}

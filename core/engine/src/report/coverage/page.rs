//! The page of the coverage test.

use lacuna::diagnose::coverage::{Coverage, Word, rank_points, ranks};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::drawing::ranks_of;
use super::{edge, intervals, places, said, shapes, verdict};
use crate::page::chart::Key;
use crate::page::drawing::Drawing;
use crate::page::{Caption, Numbers, SCRIPT, paragraph, style};

/// The counts as one HTML file, the verdict first.
pub fn coverage_page(found: &Coverage) -> String {
    let mut numbers = Numbers::default();
    let good = found.tally.verdict.word == Word::Nominal;
    let class = if good { "verdict good" } else { "verdict" };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(format!("Lacuna {}", found.version));
                title { "Coverage: " (found.title) }
                style { (PreEscaped(style())) }
            }
            body {
                header {
                    p.kicker { "Lacuna " (found.version) " · coverage" }
                    h1 { (found.title) }
                    p.study { "Study " code { (found.study) } " · seed " code { (found.seed) } }
                }
                main {
                    div.headline {
                        p class=(class) { (paragraph(&verdict(found))) }
                        @for sentence in said(found) { p { (paragraph(&sentence)) } }
                    }
                    section id="intervals" { h2 { "Intervals" } (tables(found, &mut numbers)) }
                    section id="ranks" { h2 { "Ranks" } (figure(found, &mut numbers)) }
                }
                footer { "Made by Lacuna " (found.version) " from study " code { (found.study) } "." }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

fn tables(found: &Coverage, numbers: &mut Numbers) -> Markup {
    let holds = Caption::new(
        "How many truths the central posterior intervals hold, in per cent, with the 95 % interval of each share \
         (Clopper and Pearson). In the last row the unknowns of one case count as so many independent ones as their \
         scatter between cases says.",
        "sampling error of a count of calibrations.",
        "`low` and `high`: outside what chance gives in 99 % of such counts.",
    );
    let edges = Caption::new(
        format!(
            "The 95 % intervals where the truth is at an edge of the prior, and elsewhere. {}. A right interval holds less \
             than 95 % of those at an edge where the data say little, and more elsewhere; `expected` is what the \
             posteriors themselves say of it.",
            edge()
        ),
        "sampling error of a count of calibrations.",
        "shares at an edge far below the expected ones: the emulator is worse there than it says.",
    );
    let widths = Caption::new(
        "What the data teach: the posterior standard deviation over that of the prior (median and range over the cases), and \
         the error of the posterior mean in posterior standard deviations (z).",
        "cases.",
        "a standard deviation of z above 1: intervals too narrow.",
    );
    html! {
        (numbers.table(&intervals(&found.tally), &holds))
        (numbers.table(&places(&found.tally), &edges))
        (numbers.table(&shapes(&found.tally), &widths))
    }
}

fn figure(found: &Coverage, numbers: &mut Numbers) -> Markup {
    let cases = found.tally.calibrated;
    let band = ranks::band(cases, &rank_points(cases), 0.99);
    let rows = found.tally.rows.iter().filter(|row| row.of_prior && !row.ranks.is_empty());
    let drawings: Vec<Drawing> = rows.flat_map(|row| ranks_of(row, &band)).collect();
    let caption = Caption::new(
        "The rank of each truth among 99 thinned draws of its posterior, as a share: how many truths fall into each \
         twentieth (left), and the empirical distribution function less that of uniform ranks (right), with the bands \
         that uniform ranks leave with 1 % (at one bar; anywhere: Säilynoja, Bürkner and Vehtari 2022).",
        "ranks of truths drawn from the prior (Talts et al. 2018).",
        "a U shape: posteriors too narrow; a hill: too wide; a slope: shifted.",
    );
    let keys = [
        Key::area("s-part", "truths"),
        Key::line("line s-map", "difference"),
        Key::area("s-band", "99 % band"),
    ];
    if drawings.is_empty() {
        html! {}
    } else {
        numbers.figure("ranks", &drawings, &keys, &caption)
    }
}

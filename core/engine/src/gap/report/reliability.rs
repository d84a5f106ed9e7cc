//! The reliability of probabilities: as a table, as a figure, and as a page of its own.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::gap::power::Rates;
use crate::gap::search::{Bin, Brier, Reliability};
use crate::page::chart::{Axis, Band, Curve, Key, Panel, small_multiples};
use crate::page::number::{fixed, percent};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, SCRIPT, paragraph, style};

/// The reliability of the printed and of the posterior probabilities as a table for the terminal; `None` without names.
pub fn reliability_text(rates: &Rates) -> Option<String> {
    let told = &rates.reliability;
    let (brier, of_posterior) = (told.brier?, rates.of_posterior.brier?);
    let scores = format!(
        "Mean squared error of the probabilities (Brier score): {}; of the posterior probabilities, as if one of the \
         candidates were exactly true: {}.\n",
        words(&brier),
        words(&of_posterior)
    );
    Some(format!("{}\n{scores}", table(told).text()))
}

fn words(brier: &Brier) -> String {
    let Brier { score, reliability, resolution, uncertainty } = brier;
    let [score, reliability, resolution, uncertainty] =
        [score, reliability, resolution, uncertainty].map(|x| fixed(*x, 3));
    format!(
        "{score} (reliability {reliability}, resolution {resolution}, uncertainty {uncertainty})"
    )
}

/// The bins with the share that was right.
fn table(told: &Reliability) -> Table {
    let columns = ["names", "right", "mean told", "share right", "95 % interval"];
    let mut table = Table::new(&["probability told"], &columns);
    for bin in told.bins.iter().filter(|bin| bin.cases > 0) {
        let [low, high] = bin.interval.map(percent);
        table.row([
            format!("{} to {}", fixed(bin.between[0], 2), fixed(bin.between[1], 2)),
            bin.cases.to_string(),
            bin.right.to_string(),
            fixed(bin.told, 2),
            percent(bin.share),
            format!("{low} to {high}"),
        ]);
    }
    table
}

/// The share of right names against the told probability.
pub fn figure(panels: &[(&str, &Reliability)], numbers: &mut Numbers) -> Markup {
    let panel = |(title, told): &(&str, &Reliability)| {
        let used: Vec<&Bin> = told.bins.iter().filter(|bin| bin.cases > 0).collect();
        let edges = used.iter().map(|bin| (bin.told, bin.interval[0], bin.interval[1]));
        let points = used.iter().map(|bin| (bin.told, bin.share));
        let brier = told.brier.map(|b| format!("Brier score {}", fixed(b.score, 3)));
        Panel {
            title: (*title).to_owned(),
            remark: brier.unwrap_or_default(),
            bands: vec![Band { class: "s-band", edges: edges.collect() }],
            curves: vec![
                Curve {
                    class: "s-equal",
                    name: String::new(),
                    points: vec![(0.0, 0.0), (1.0, 1.0)],
                },
                Curve { class: "s-map", name: "right".into(), points: points.collect() },
            ],
        }
    };
    let panels: Vec<Panel> = panels.iter().map(panel).collect();
    let x = Axis::new("probability told", (0.0, 1.0)).ticks(5);
    let y = Axis::new("share right", (0.0, 1.0)).ticks(5);
    let keys = [
        Key::line("s-map", "share of the names that were right"),
        Key::area("s-band", "its 95 % interval"),
        Key::line("s-equal", "told and right alike"),
    ];
    let caption = Caption::new(
        "The names that the search gave in simulated cases of this study, by the probability that it told with them. Half \
         of the weight have effects of the library, half changes of another form.",
        "counts of cases (Clopper and Pearson's interval).",
        "a line below the dashed one: names are less often right than was told.",
    );
    let drawings = small_multiples(&panels, &x, &y, "reliability");
    numbers.figure("reliability-of-names", &drawings, &keys, &caption)
}

/// The page of a study's power: its rates as they are printed, and the reliability of its probabilities.
pub fn power_page(title: &str, rates: &Rates) -> String {
    let mut numbers = Numbers::default();
    let both = [("as printed by default", &rates.reliability), ("posterior", &rates.of_posterior)];
    let heading = format!("What can be found: {title}");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (heading) }
                style { (PreEscaped(style())) }
            }
            body {
                header { p.kicker { "Lacuna · power" } h1 { (heading) } }
                main { section id="power" {
                    p { (paragraph("The search on data simulated from the study's own calibrated model and noise.")) }
                    (figure(&both, &mut numbers))
                    pre { (super::power::power_text(rates)) }
                } }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::search::Told;

    /// Ten names that were told with 0.7, of which five are right: a share of one half, and a Brier score of
    /// `(5 * 0.3^2 + 5 * 0.7^2) / 10 = 0.29`.
    #[test]
    fn a_count_is_told_and_drawn() {
        let told = |i: usize| Told { probability: 0.7, right: i < 5, weight: 1.0 };
        let count = Reliability::of(&(0..10).map(told).collect::<Vec<_>>());
        assert!(table(&count).text().contains("50.0 %"), "{}", table(&count).text());
        let drawn = figure(&[("ours", &count)], &mut Numbers::default()).into_string();
        assert!(drawn.contains("Brier score 0.290") && drawn.contains("<svg"), "{drawn}");
    }
}

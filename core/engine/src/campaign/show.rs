//! State of a campaign as text.

use super::{Row, State, Status};

/// Largest number of characters of a note that are shown.
const WIDTH: usize = 240;

/// Text with the counts of each stage and scenario, then one line for every run that is not done, or for all.
pub fn text(status: &Status, all: bool) -> String {
    let mut text = String::new();
    for warning in &status.warnings {
        text.push_str(&format!("warning: {warning}\n"));
    }
    let mut groups: Vec<(&str, &str)> = Vec::new();
    for row in &status.runs {
        let group = (row.stage.as_str(), row.scenario.as_str());
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    for (stage, scenario) in groups {
        let rows: Vec<&Row> = status
            .runs
            .iter()
            .filter(|row| row.stage == stage && row.scenario == scenario)
            .collect();
        let name =
            if scenario.is_empty() { stage.to_owned() } else { format!("{stage}, {scenario}") };
        text.push_str(&format!("{name}: {} runs, {}\n", rows.len(), counts(&rows)));
        for state in State::ALL.into_iter().filter(|&state| all || state != State::Done) {
            let some: Vec<(usize, &Row)> =
                rows.iter().copied().enumerate().filter(|(_, row)| row.state == state).collect();
            // A message from the cluster often applies to hundreds of runs.
            for same in some.chunk_by(|(_, a), (_, b)| !a.note.is_empty() && a.note == b.note) {
                text.push_str(&line(same));
            }
        }
    }
    if text.is_empty() {
        text.push_str("no runs have been requested yet\n");
    }
    text
}

fn counts(rows: &[&Row]) -> String {
    let count = |state: State| rows.iter().filter(|row| row.state == state).count();
    let some = State::ALL.into_iter().filter(|&state| count(state) > 0);
    some.map(|state| format!("{} {}", count(state), state.name())).collect::<Vec<_>>().join(", ")
}

/// One line for runs with the same message, each with its index among all.
fn line(rows: &[(usize, &Row)]) -> String {
    let [(first, row), others @ ..] = rows else { return String::new() };
    let name = match others.last() {
        Some((place, last)) if place - first + 1 == rows.len() => {
            format!("{} to {} ({})", row.run, last.run, rows.len())
        }
        // The runs are not contiguous: runs in another state lie between them.
        Some(_) => format!("{} and {} more", row.run, others.len()),
        None => row.run.clone(),
    };
    let note: String = row.note.replace('\n', "; ");
    let note = match note.char_indices().nth(WIDTH) {
        Some((cut, _)) => format!("{}…", &note[..cut]),
        None => note,
    };
    let seconds = row.seconds.map_or(String::new(), |s| format!("{s:.1} s"));
    let text = format!("  {name:<10} {:<8} {seconds:>10}  {note}", row.state.name());
    text.trim_end().to_owned() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_done_has_a_line() {
        let row = |run: &str, state: State, note: &str| Row {
            stage: "2-simulate".to_owned(),
            scenario: String::new(),
            run: run.to_owned(),
            state,
            note: note.to_owned(),
            seconds: (state == State::Done).then_some(1.5),
        };
        let runs = vec![
            row("run001", State::Done, ""),
            row("run002", State::Failed, "exit code 7\nand more"),
            row("run003", State::Waiting, "job 1, task 2: PENDING"),
            row("run004", State::Failed, "no such command"),
            row("run005", State::Failed, "no such command"),
            row("run006", State::Failed, "no memory"),
            row("run007", State::Done, ""),
            row("run008", State::Failed, "no memory"),
        ];
        let status = Status { runs, warnings: Vec::new() };
        let expected = "\
2-simulate: 8 runs, 2 done, 1 waiting, 5 failed
  run003     waiting              job 1, task 2: PENDING
  run002     failed               exit code 7; and more
  run004 to run005 (2) failed               no such command
  run006 and 1 more failed               no memory
";
        assert_eq!(text(&status, false), expected);
        assert!(text(&status, true).contains("  run001     done          1.5 s\n"));
    }
}

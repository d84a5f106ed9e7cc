#![allow(clippy::unwrap_used)]

use crate::plugin::registry::kinds;

fn manual(name: &str) -> super::Manual {
    let kind = kinds().into_iter().find(|kind| kind.name == "instrument").unwrap();
    let plugins = kind.plugins();
    plugins.iter().find(|plugin| plugin.name == name).unwrap().manual().unwrap()
}

#[test]
fn the_terminal_page_shows_every_option() {
    let expected = "\
instrument.whistle

A whistle.

It has one hole more than a flute.

Blow gently:

    [instrument]
    use = \"whistle\"

- first
- second

options

  volume: a number from 0 to 1, default 0.5
      Loudness of the note, as a share of the loudest.

  holes: a whole number of 1 or more
      The holes.

  tuning: a choice, default \"equal\"
      Tuning of the whistle.
      - \"equal\": As the piano is.
      - { just = { root = … } }: As the ear likes it.

  tuning.just.root: a number, required
      The lowest note.

  case: a table, default { material = \"wood\" }
      Case of the whistle.

  case.material: a string, default \"wood\"
      Material of the case.
";
    let page = manual("whistle").plain();
    assert_eq!(page, expected, "{page}");
}

#[test]
fn the_book_page_has_a_table() {
    let expected = "\
# `instrument.drum`

Drums need no options but one.

| option | value | default | meaning |
|---|---|---|---|
| `sticks` | a whole number of 1 or more | required | Number of sticks. |
";
    assert_eq!(manual("drum").markdown(), expected);
    let page = manual("whistle").markdown();
    let row = "| `tuning` | a choice | `\"equal\"` | Tuning of the whistle.<br>\
               • `\"equal\"`: As the piano is.<br>• `{ just = { root = … } }`: As the ear likes it. |";
    assert!(page.lines().any(|line| line == row), "{page}");
}

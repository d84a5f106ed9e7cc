//! Commands `completions` and `man`: what a shell and the reader of manuals know of the arguments.

use clap::CommandFactory as _;

use crate::Arguments;
use crate::terminal::print_styled;

/// Prints the completions of a shell.
pub fn completions(shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "lacuna", &mut text);
    print_styled(String::from_utf8(text)?.trim_end());
    Ok(())
}

/// Prints the manual page, with a section for each command.
pub fn page() -> anyhow::Result<()> {
    let mut text = Vec::new();
    let whole = Arguments::command();
    clap_mangen::Man::new(whole.clone()).render(&mut text)?;
    for command in whole.get_subcommands().filter(|command| !command.is_hide_set()) {
        let name: &'static str =
            Box::leak(format!("lacuna {}", command.get_name()).into_boxed_str());
        let page = clap_mangen::Man::new(command.clone().display_name(name).bin_name(name));
        page.render_synopsis_section(&mut text)?;
        page.render_description_section(&mut text)?;
        page.render_options_section(&mut text)?;
    }
    print_styled(String::from_utf8(text)?.trim_end());
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn every_command_is_completed_and_described() {
        let whole = Arguments::command();
        let mut bash = Vec::new();
        clap_complete::generate(
            clap_complete::Shell::Bash,
            &mut Arguments::command(),
            "lacuna",
            &mut bash,
        );
        let bash = String::from_utf8(bash).unwrap();
        for command in whole.get_subcommands() {
            assert!(bash.contains(command.get_name()), "{}", command.get_name());
        }
        assert!(bash.contains("--threads"));
    }
}

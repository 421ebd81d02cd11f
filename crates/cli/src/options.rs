//! Settings in messages, spelled as options of the command line.

use clap::CommandFactory as _;

use crate::commands::Cli;

/// Returns a message in which the settings between backticks, such as `sample_rate`, are written as
/// the options of the program, such as --sample-rate. Other text is not changed.
pub fn spelled(message: &str) -> String {
    let mut pieces = message.split('`');
    let mut spelled = pieces.next().unwrap_or_default().to_owned();
    // Pieces alternate between inside and outside of backticks.
    while let Some(inside) = pieces.next() {
        let outside = pieces.next();
        match (option(inside), outside) {
            (Some(option), Some(outside)) => spelled = spelled + "--" + &option + outside,
            (_, Some(outside)) => spelled = spelled + "`" + inside + "`" + outside,
            (_, None) => spelled = spelled + "`" + inside,
        }
    }
    spelled
}

/// Returns the option for the name of a setting; `None` if no subcommand has this option.
fn option(setting: &str) -> Option<String> {
    let name = setting.replace('_', "-");
    Cli::command().get_subcommands().any(|command| takes(command, &name)).then_some(name)
}

/// Returns whether a subcommand has an option.
pub fn has(subcommand: &str, option: &str) -> bool {
    Cli::command().find_subcommand(subcommand).is_some_and(|command| takes(command, option))
}

fn takes(command: &clap::Command, option: &str) -> bool {
    command.get_arguments().any(|argument| argument.get_long() == Some(option))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_become_options() {
        assert_eq!(
            spelled("name it with `time`, or give `sample_rate` in Hz: `file`"),
            "name it with --time, or give --sample-rate in Hz: `file`"
        );
        assert_eq!(spelled("a file called `x"), "a file called `x");
    }
}

//! Checks of the help of every subcommand, such as its examples and the units of its options.

use std::any::TypeId;

use clap::{Arg, CommandFactory as _, Parser as _};

use super::Cli;

/// Placeholders of option values and the units that the help texts must state for them.
const UNITS: [(&str, &str); 8] = [
    ("GB", "GB"),
    ("HZ", "Hz"),
    ("N", "N"),
    ("DB", "dB"),
    ("KG", "kg"),
    ("METRES", "in m"),
    ("SECONDS", "in s"),
    ("PA·S", "Pa·s"),
];

/// Placeholders in help texts for numbers without a unit.
const PURE: [&str; 9] =
    ["PERCENT", "STEPS", "RATIO", "LAMBDA", "BETA", "GAMMA", "THETA", "RADIUS", "FRACTION,…"];

fn subcommands() -> Vec<clap::Command> {
    let mut program = Cli::command();
    program.build();
    let all: Vec<_> =
        program.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
    assert!(all.len() >= 10);
    all
}

/// Returns the examples of a help text, each on one line; a backslash at the end continues a line.
fn examples(help: &str) -> Vec<String> {
    let (_, block) = help.split_once("Examples:\n").unwrap_or_default();
    let joined = block.replace("\\\n", " ");
    joined.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()
}

/// Returns the words of a command, as a shell splits it: text between quotes is one word.
fn words(call: &str) -> Vec<&str> {
    let parts = call.split('\'').enumerate();
    parts
        .flat_map(|(k, part)| match k % 2 {
            0 => part.split_whitespace().collect(),
            _ => vec![part],
        })
        .collect()
}

#[test]
fn every_subcommand_has_examples_that_are_understood() {
    for command in subcommands() {
        let name = command.get_name();
        let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        let examples = examples(&help);
        assert!(!examples.is_empty(), "{name} --help has no Examples:");
        for example in &examples {
            // The shell handles a redirection, which is not an argument of the program.
            let call = example.split_once(" > ").map_or(example.as_str(), |(call, _)| call);
            let parsed = Cli::try_parse_from(words(call));
            assert!(parsed.is_ok(), "{example}\n{}", parsed.unwrap_err());
        }
        assert!(examples.iter().any(|e| e.starts_with(&format!("mechid {name}"))), "{name}");
    }
}

#[test]
fn every_subcommand_can_be_quiet() {
    for command in subcommands().iter().filter(|c| c.get_name() != "completions") {
        for option in ["quiet", "json"] {
            let has = command.get_arguments().any(|arg| arg.get_long() == Some(option));
            assert!(has, "{} has no --{option}", command.get_name());
        }
    }
}

#[test]
fn every_option_is_explained_and_names_its_unit() {
    for command in subcommands() {
        for arg in command.get_arguments() {
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            let place = format!("{} {}", command.get_name(), arg.get_id());
            assert!(!help.is_empty(), "{place} has no help");
            if arg.get_value_parser().type_id() != TypeId::of::<f64>() {
                continue;
            }
            let name = value_name(arg);
            let unit = UNITS.iter().find(|(value, _)| name.starts_with(value));
            match unit {
                Some((_, unit)) => assert!(help.contains(unit), "{place}: {help}"),
                // If the placeholder implies no unit, it must be one for numbers without a unit, or
                // the help text must say which unit the number has, such as that of the column.
                None => assert!(
                    PURE.contains(&name.as_str()) || help.contains("unit"),
                    "{place} takes a number called {name}: which unit?"
                ),
            }
        }
    }
}

fn value_name(arg: &Arg) -> String {
    arg.get_value_names()
        .and_then(|names| names.first())
        .map(ToString::to_string)
        .unwrap_or_default()
}

#[test]
fn the_exit_codes_are_documented() {
    let help = Cli::command().render_long_help().to_string();
    let codes = "Exit codes:\n  0    success\n  1    fleet: some of the records have no result\n  2    any other failure";
    assert!(help.contains(codes), "{help}");
}

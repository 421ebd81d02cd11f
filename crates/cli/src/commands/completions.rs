//! `mechid completions`: scripts for the completion of subcommands and options in a shell.

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;

use super::Cli;
use crate::args::ReportArgs;
use crate::error::CliError;
use crate::outcome::Outcome;

/// Print a script that lets a shell complete subcommands and options
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid completions bash > ~/.local/share/bash-completion/completions/mechid
  mechid completions zsh > ~/.zfunc/_mechid
  mechid completions fish > ~/.config/fish/completions/mechid.fish")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
    /// Unused: the script is the only output.
    #[arg(skip)]
    pub report: ReportArgs,
}

impl CompletionsArgs {
    /// Writes the script.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "mechid", &mut script);
        Ok(Outcome::from_text(String::from_utf8_lossy(&script).into_owned()))
    }
}

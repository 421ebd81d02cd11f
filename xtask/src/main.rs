//! Project tasks.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use indicatif::ProgressBar;
use xtask::figures;

/// Project tasks.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Tasks {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Draw the dissertation's figures: sketches, block diagrams, and plots with their numbers.
    Figures {
        /// Folder the files go to.
        #[arg(default_value = "docs/thesis/figures")]
        folder: PathBuf,
        /// Only this figure (5.6.10) or this part (5.6, P1).
        #[arg(long, default_value = "")]
        only: String,
        /// Write PNG files as well.
        #[arg(long)]
        png: bool,
    },
}

fn main() -> ExitCode {
    let done = match Tasks::parse().task {
        Task::Figures { folder, only, png } => {
            let wanted = |number: &str| figures::selects(&only, number);
            let bar = ProgressBar::new(figures::count(wanted) as u64);
            let done = figures::write(&folder, wanted, png, || bar.inc(1));
            bar.finish_and_clear();
            done.map(|files| println!("{} files in {}", files.len(), folder.display()))
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(words) => {
            eprintln!("{words}");
            ExitCode::from(2)
        }
    }
}

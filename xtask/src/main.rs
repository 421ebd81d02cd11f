//! Project tasks.

mod drawing;

use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// Project tasks.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Tasks {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Draw the dissertation's model sketches and block diagrams.
    Sketches {
        /// Folder the SVG files go to.
        #[arg(default_value = "docs/thesis/figures")]
        folder: PathBuf,
        /// Draw PNG files as well.
        #[arg(long)]
        png: bool,
    },
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    match Tasks::parse().task {
        Task::Sketches { folder, png } => sketches(&folder, png),
    }
}

fn sketches(folder: &std::path::Path, png: bool) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    for drawing in drawing::all() {
        let file = folder.join(format!("figure-{}.svg", drawing.number));
        mechid::plot::save_svg(&file, &drawing.svg)?;
        if png {
            mechid::plot::save_svg(file.with_extension("png"), &drawing.svg)?;
        }
    }
    Ok(())
}

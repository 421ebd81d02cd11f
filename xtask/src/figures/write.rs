//! Every figure of the dissertation as files.

use std::path::{Path, PathBuf};

use super::{compute, numbers, table};
use crate::drawing;

/// Whether `only` names the figure `number` or a part of the dissertation it belongs to:
/// `5.6` means 5.6.1, 5.6.2 and so on, `P1` the first paper, nothing everything.
pub fn selects(only: &str, number: &str) -> bool {
    only.is_empty()
        || number
            .strip_prefix(only)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '-']))
}

/// How many figures `wanted` asks for, drawings and data figures together.
pub fn count(wanted: impl Fn(&str) -> bool) -> usize {
    let drawings = drawing::NUMBERS.iter().filter(|number| wanted(number)).count();
    drawings + numbers().into_iter().filter(|number| wanted(number)).count()
}

/// Writes the wanted figures to `folder` as `figure-5.2.4.svg` with the numbers beside it as `.csv`
/// (drawings have none), and as `.png` too if asked; returns the files in the order written.
/// `tick` is called after each figure.
///
/// # Errors
/// The number of the first figure that fails and why, or what the file system refuses.
pub fn write(
    folder: &Path,
    wanted: impl Fn(&str) -> bool,
    png: bool,
    tick: impl Fn() + Sync,
) -> Result<Vec<PathBuf>, String> {
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut written = Vec::new();
    for made in drawing::all().into_iter().filter(|made| wanted(made.number)) {
        save(folder, made.number, &made.svg, png, &mut written)?;
        tick();
    }
    for made in compute(wanted, tick)? {
        let svg =
            made.figure.to_svg().map_err(|error| format!("figure {}: {error}", made.number))?;
        let file = save(folder, made.number, &svg, png, &mut written)?.with_extension("csv");
        std::fs::write(&file, table(&made.figure)?)
            .map_err(|error| format!("{}: {error}", file.display()))?;
        written.push(file);
    }
    Ok(written)
}

fn save(
    folder: &Path,
    number: &str,
    svg: &str,
    png: bool,
    written: &mut Vec<PathBuf>,
) -> Result<PathBuf, String> {
    let file = folder.join(format!("figure-{number}.svg"));
    let endings: &[&str] = if png { &["svg", "png"] } else { &["svg"] };
    for ending in endings {
        let target = file.with_extension(ending);
        mechid::plot::save_svg(&target, svg).map_err(|error| error.to_string())?;
        written.push(target);
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn a_number_or_a_section_selects() {
        let chosen =
            |only: &str| numbers().into_iter().filter(|number| selects(only, number)).count();
        assert_eq!((chosen("5.6.1"), chosen("5.6.10"), chosen("5.6"), chosen("P1")), (0, 1, 16, 5));
        assert_eq!(chosen(""), numbers().len());
    }

    #[test]
    fn wanted_figures_become_files_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let wanted = |number: &str| number == "4.2.1" || number == "5.2.2";
        let ticks = AtomicUsize::new(0);
        let written = write(folder.path(), wanted, false, || {
            ticks.fetch_add(1, Ordering::Relaxed);
        })
        .unwrap();
        let mut names: Vec<String> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        assert_eq!(names, ["figure-4.2.1.svg", "figure-5.2.2.csv", "figure-5.2.2.svg"]);
        assert_eq!((written.len(), ticks.into_inner(), count(wanted)), (3, 2, 2));
    }
}

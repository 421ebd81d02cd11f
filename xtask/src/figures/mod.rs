//! The dissertation's figures that show data, each with the numbers it is drawn from.
//!
//! A figure that depends on the slips of the original programs has two parts on the same scale: on
//! the left the curves with the slips, on the right the curves without them.

mod csv;
mod excitation;
mod force_spectra;
mod frequency_responses;
mod series;
mod sweeps;

use mechid::plot::Figure;
use rayon::prelude::*;

pub use self::csv::table;

/// One figure with its number in the dissertation.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbered {
    /// Number of the figure, such as `5.2.4`; `P1-4` is figure 4 of the first paper of Appendix D.
    pub number: &'static str,
    /// The figure.
    pub figure: Figure,
}

/// A figure to be computed: its number, and the function that draws it.
pub(crate) struct Plan {
    pub(crate) number: &'static str,
    pub(crate) draw: Box<dyn Fn() -> Result<Figure, String> + Send + Sync>,
}

/// The numbers of all figures, in the order of the dissertation.
pub fn numbers() -> Vec<&'static str> {
    plans().iter().map(|plan| plan.number).collect()
}

/// Computes the figures that `wanted` selects, in parallel; `tick` is called after each.
///
/// # Errors
/// Number of the first figure that fails, and the message of the library.
pub fn compute(
    wanted: impl Fn(&str) -> bool,
    tick: impl Fn() + Sync,
) -> Result<Vec<Numbered>, String> {
    let chosen: Vec<Plan> = plans().into_iter().filter(|plan| wanted(plan.number)).collect();
    chosen
        .into_par_iter()
        .map(|plan| {
            let figure =
                (plan.draw)().map_err(|words| format!("figure {}: {words}", plan.number))?;
            tick();
            Ok(Numbered { number: plan.number, figure })
        })
        .collect()
}

fn plans() -> Vec<Plan> {
    let mut plans = excitation::plans();
    plans.extend(sweeps::plans());
    plans.extend(force_spectra::plans());
    plans.extend(frequency_responses::plans());
    plans
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    /// Checks that all figures with data are drawn: the numbered ones, those of Appendices A and C,
    /// and those of the first paper.
    #[test]
    fn no_figure_is_missing() {
        let mut expected: Vec<String> =
            ["4.3.1", "5.2.1", "5.2.2", "5.3.1", "5.3.2", "5.3.4", "5.3.5"]
                .map(str::to_owned)
                .to_vec();
        let mut series = |section: &str, numbers: &mut dyn Iterator<Item = u32>| {
            expected.extend(numbers.map(|n| format!("{section}{n}")));
        };
        series("5.2.", &mut (4..=9));
        series("5.4.", &mut [2, 3, 5, 6].into_iter());
        series("5.5.", &mut (2..=3));
        series("5.6.", &mut (2..=17));
        series("5.7.", &mut (2..=9));
        series("5.8.", &mut [2, 3, 4, 5, 7, 8].into_iter());
        series("5.9.", &mut (2..=3));
        series("P1-", &mut (3..=7));
        let appendices =
            ["A-stiffness", "A-damping", "A-force-npi-10", "A-force-npi-20", "C-sdof", "C-bearing"];
        expected.extend(appendices.map(str::to_owned));
        let drawn: HashSet<&str> = numbers().into_iter().collect();
        assert_eq!(drawn, expected.iter().map(String::as_str).collect());
        assert_eq!(numbers().len(), drawn.len(), "no number twice");
    }

    #[test]
    fn figures_draw_and_their_tables_hold_every_point() {
        let made = compute(
            |number| ["4.3.1", "5.2.4", "5.3.4", "5.8.2", "C-sdof"].contains(&number),
            || {},
        )
        .unwrap();
        assert_eq!(made.len(), 5);
        for Numbered { number, figure } in &made {
            assert!(figure.to_svg().unwrap().contains(number), "{number}");
            let text = table(figure).unwrap();
            let filled: usize = text
                .lines()
                .skip(1)
                .map(|row| row.split(',').filter(|cell| cell.parse::<f64>().is_ok()).count())
                .sum();
            let drawn: usize = figure
                .panels()
                .iter()
                .flat_map(|panel| panel.data())
                .map(|curve| curve.y().len())
                .sum();
            assert!(filled > drawn, "{number}: {filled} numbers for {drawn} points");
        }
    }

    /// Checks the smallest and the largest |F̂/F| of the spectral lines: a separate program in
    /// another programming language computed the same values.
    #[test]
    fn identified_forces_span_the_ranges_found_independently() {
        let ranges = [
            ("5.4.2", "Newmark", (0.800, 1.121)),
            ("5.4.2", "Houbolt", (0.519, 1.056)),
            ("5.4.2", "Wilson θ", (0.352, 0.925)),
            ("5.4.3", "Newmark", (1.000, 1.016)),
            ("5.4.3", "Houbolt", (0.685, 0.992)),
            ("5.4.3", "Wilson θ", (0.553, 1.006)),
            ("5.5.2", "Newmark", (0.010, 0.800)),
            ("5.5.2", "Houbolt", (0.464, 0.756)),
            ("5.5.3", "Wilson θ", (0.012, 1.006)),
            ("5.8.2", "Newmark", (0.922, 1.009)),
            ("5.8.2", "Wilson θ", (0.189, 0.952)),
            ("5.8.3", "Houbolt", (0.477, 0.924)),
            ("5.8.4", "Newmark", (0.950, 1.018)),
            ("5.8.5", "Wilson θ", (0.171, 0.943)),
        ];
        let made =
            compute(|number| ranges.iter().any(|(wanted, ..)| *wanted == number), || {}).unwrap();
        for (number, method, (low, high)) in ranges {
            let figure = &made.iter().find(|made| made.number == number).unwrap().figure;
            let replayed = &figure.panels()[0];
            let truth = replayed.references()[0].value();
            let curve = replayed.data().iter().find(|curve| curve.label() == method).unwrap();
            let least = curve.y().iter().copied().fold(f64::INFINITY, f64::min) / truth;
            let most = curve.y().iter().copied().fold(0.0, f64::max) / truth;
            // The ranges are rounded to three decimals.
            assert!(
                (least - low).abs() <= 6e-4 && (most - high).abs() <= 6e-4,
                "{number} {method}: {least} to {most}"
            );
        }
    }
}

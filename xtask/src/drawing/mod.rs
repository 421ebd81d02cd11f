//! The dissertation's drawings without data: model sketches and block diagrams.

mod block_diagram;
mod diagrams;
mod sketches;
mod symbols;

use diagrams::{Domain, ForceEquation, Machine};

/// One drawing with its number in the dissertation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawing {
    /// Number of the figure, such as `5.4.1`.
    pub number: &'static str,
    /// The drawing as an SVG document.
    pub svg: String,
}

/// Numbers of the drawings, in the order of the dissertation.
const NUMBERS: [&str; 14] = [
    "4.2.1", "4.2.2", "4.2.3", "5.2.3", "5.3.3", "5.4.1", "5.4.4", "5.5.1", "5.6.1", "5.7.1",
    "5.8.1", "5.8.6", "5.9.1", "E1",
];

/// Returns all drawings, in the order of the dissertation.
pub fn all() -> Vec<Drawing> {
    use Domain::{Frequency, Time};
    use ForceEquation::{Continuous, Discretised};
    use Machine::{Bearing, Sdof};
    let drawn = [
        sketches::mass_spring_damper(),
        sketches::shaft_and_bearing(),
        sketches::bearing_scheme(),
        diagrams::identification(Sdof, Time),
        diagrams::identification(Sdof, Frequency),
        diagrams::force(Sdof, Time, Continuous),
        diagrams::force(Sdof, Frequency, Continuous),
        diagrams::force(Sdof, Time, Discretised),
        diagrams::identification(Bearing, Time),
        diagrams::identification(Bearing, Frequency),
        diagrams::force(Bearing, Time, Continuous),
        diagrams::force(Bearing, Frequency, Continuous),
        diagrams::force(Bearing, Time, Discretised),
        diagrams::modal(),
    ];
    NUMBERS.into_iter().zip(drawn).map(|(number, svg)| Drawing { number, svg }).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_drawing_has_its_own_number_and_becomes_a_bitmap() {
        let drawings = all();
        assert_eq!(drawings.iter().map(|d| d.number).collect::<HashSet<_>>().len(), 14);
        assert_eq!(
            drawings.iter().map(|d| &d.svg).collect::<HashSet<_>>().len(),
            14,
            "no two are alike"
        );
        for drawing in &drawings {
            // The rasteriser parses the document, so a document that it accepts is well-formed SVG.
            let bitmap = mechid::plot::svg_to_png(&drawing.svg, 0.5);
            assert!(bitmap.is_ok(), "{}: {bitmap:?}", drawing.number);
            assert!(
                !drawing.svg.contains("NaN") && !drawing.svg.contains("inf"),
                "{}",
                drawing.number
            );
        }
    }

    #[test]
    fn diagrams_name_the_equation_they_rest_on() {
        for (number, equation) in [
            ("5.2.3", "(4.5.12)"),
            ("5.3.3", "(4.6.12)"),
            ("5.4.1", "(4.8.2)"),
            ("5.4.4", "(4.6.12)"),
            ("5.5.1", "(4.7.2)"),
            ("5.6.1", "(4.5.28)"),
            ("5.7.1", "(4.6.31)"),
            ("5.8.1", "(4.8.3)"),
            ("5.8.6", "(4.6.31)"),
            ("5.9.1", "(4.7.3)"),
        ] {
            let drawing = all().into_iter().find(|drawing| drawing.number == number);
            assert!(
                drawing.is_some_and(|drawing| drawing.svg.contains(equation)),
                "{number} lacks {equation}"
            );
        }
    }
}

//! Shapes of modes on the points of a structure: deflected lines, likeness of the shapes, stabilisation.

use mechid_analysis::modal::ShapedMode;
use mechid_analysis::text::{compact, significant};
use mechid_io::{Geometry, PointShape};
use mechid_plot::{Axis, Color, Curve, DrawnMode, DrawnSet, Figure, Panel, ShapeDrawing};
use nalgebra::Complex;

/// Modes with their shapes at the points of a structure.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeShapes {
    /// The points, and the lines between them.
    pub geometry: Geometry,
    /// The modes, by rising frequency; each with a displacement for every point.
    pub modes: Vec<PointShape>,
}

/// A pole of a model of some order, in a stabilisation diagram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StabilisationPole {
    /// Order of the model.
    pub order: usize,
    /// Natural frequency, in Hz.
    pub frequency_hz: f64,
    /// Damping ratio, a pure number.
    pub damping_ratio: f64,
    /// `true` if frequency and damping repeat those of the order below.
    pub is_stable: bool,
}

impl ModeShapes {
    /// Gathers identified modes whose entries have these names, such as `1+Z`, on a geometry; without one, on a
    /// row or a grid of points by their names. `None` without modes that oscillate, for fewer than two entries, and
    /// where an entry has no point.
    pub fn from_modes(
        modes: &[ShapedMode],
        names: &[String],
        geometry: Option<&Geometry>,
    ) -> Option<Self> {
        let geometry = match geometry {
            Some(geometry) => geometry.clone(),
            None => Geometry::from_names(names.iter().map(String::as_str)),
        };
        let of_mode = |mode: &ShapedMode| {
            let shape: Vec<[f64; 2]> = mode.shape.iter().map(|entry| entry.value).collect();
            Some(PointShape {
                frequency_hz: mode.row.natural_frequency_hz.value,
                damping_ratio: mode.row.damping_ratio.value,
                displacement: geometry.displacement(names, &shape)?,
            })
        };
        let oscillating = modes.iter().filter(|mode| mode.row.oscillates);
        let modes: Vec<PointShape> = oscillating.map(of_mode).collect::<Option<_>>()?;
        (!modes.is_empty() && names.len() > 1).then_some(Self { geometry, modes })
    }

    /// Draws the first mode over the undeformed lines, and every mode small, for the script that animates them.
    pub fn draw(&self, label: &str) -> DrawnSet {
        let points = self.geometry.points.iter();
        let mode = |(number, mode): (usize, &PointShape)| DrawnMode {
            name: format!(
                "mode {number}: {} Hz, damping ratio {} %",
                compact(mode.frequency_hz, 5),
                significant(100.0 * mode.damping_ratio, 3)
            ),
            short_name: format!("{number}: {} Hz", compact(mode.frequency_hz, 4)),
            displacement: mode.displacement.clone(),
        };
        let drawing = ShapeDrawing {
            points: points.map(|point| (point.name.clone(), point.position)).collect(),
            lines: self.geometry.lines.clone(),
            modes: (1..).zip(&self.modes).map(mode).collect(),
        };
        drawing.draw(label)
    }

    /// Returns the modal assurance criterion of each pair of modes, a square matrix of pure
    /// numbers: 1 for the same shape, 0 for orthogonal ones.
    ///
    /// # Source
    /// R. J. Allemang and D. L. Brown, "A correlation coefficient for modal vector analysis", IMAC 1 (1982).
    pub fn assurance(&self) -> Vec<Vec<f64>> {
        let entries = |mode: &PointShape| -> Vec<Complex<f64>> {
            mode.displacement.iter().flatten().map(|[re, im]| Complex::new(*re, *im)).collect()
        };
        let shapes: Vec<Vec<Complex<f64>>> = self.modes.iter().map(entries).collect();
        let product = |a: &[Complex<f64>], b: &[Complex<f64>]| -> Complex<f64> {
            a.iter().zip(b).map(|(a, b)| a.conj() * b).sum()
        };
        let likeness = |a: &[Complex<f64>], b: &[Complex<f64>]| {
            let power = product(a, a).re * product(b, b).re;
            if power > 0.0 { (product(a, b).norm_sqr() / power).min(1.0) } else { 0.0 }
        };
        shapes.iter().map(|a| shapes.iter().map(|b| likeness(a, b)).collect()).collect()
    }
}

/// Draws the poles of models of rising order over the sum of the responses, which is scaled to the
/// height of the diagram: its logarithm from the smallest to the largest value. `sum` has
/// frequencies, in Hz, and magnitudes, one for each frequency.
///
/// # Source
/// Peeters & Van der Auweraer (2005), Proceedings of the 1st International Operational Modal
/// Analysis Conference (stabilisation diagram).
pub fn stabilisation(title: &str, poles: &[StabilisationPole], sum: (&[f64], &[f64])) -> Figure {
    let highest = poles.iter().map(|pole| pole.order).max().unwrap_or(1) as f64;
    let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Order", ""));
    let positive = || sum.0.iter().zip(sum.1).filter(|(_, value)| **value > 0.0);
    let (low, high) =
        positive().fold((f64::INFINITY, 0.0f64), |(a, b), (_, v)| (a.min(*v), b.max(*v)));
    if high > low {
        let x: Vec<f64> = positive().map(|(hz, _)| *hz).collect();
        let scaled = |value: f64| highest * (value / low).ln() / (high / low).ln();
        let y: Vec<f64> = positive().map(|(_, value)| scaled(*value)).collect();
        let curve = Curve::line("sum of the responses, logarithm", &x, &y);
        panel = panel.curve(curve.color(Color::GREY).width(1.2));
    }
    for (name, is_stable, slot) in [("stable", true, 0), ("new or moving", false, 5)] {
        let some: Vec<&StabilisationPole> =
            poles.iter().filter(|pole| pole.is_stable == is_stable).collect();
        if some.is_empty() {
            continue;
        }
        let x: Vec<f64> = some.iter().map(|pole| pole.frequency_hz).collect();
        let y: Vec<f64> = some.iter().map(|pole| pole.order as f64).collect();
        let words = |pole: &&StabilisationPole| {
            format!(
                "order {}: {} Hz, damping ratio {} %",
                pole.order,
                compact(pole.frequency_hz, 6),
                significant(100.0 * pole.damping_ratio, 3)
            )
        };
        let notes = some.iter().map(words).collect();
        let color = if is_stable { Color::BLUE } else { Color::VERMILION };
        panel = panel.curve(Curve::points(name, &x, &y).slot(slot).color(color).notes(notes));
    }
    Figure::new(title).panel(panel)
}

#[cfg(test)]
mod tests {
    use mechid_plot::matrix_of_squares;

    use super::*;

    fn shapes(rows: &[[[f64; 2]; 2]]) -> ModeShapes {
        let names = ["1+Z".to_owned(), "2+Z".to_owned()];
        let geometry = Geometry::from_names(names.iter().map(String::as_str));
        let mode = |shape: &[[f64; 2]; 2]| PointShape {
            frequency_hz: 10.0,
            damping_ratio: 0.01,
            displacement: geometry.displacement(&names, shape).unwrap(),
        };
        let modes = rows.iter().map(mode).collect();
        ModeShapes { geometry: geometry.clone(), modes }
    }

    /// Judge: (1, 1) and (1, −1) are orthogonal, (1, i) is as far from both, and a turned shape is the same.
    #[test]
    fn assurance_is_that_of_the_definition() {
        let shapes = shapes(&[
            [[1.0, 0.0], [1.0, 0.0]],
            [[1.0, 0.0], [-1.0, 0.0]],
            [[1.0, 0.0], [0.0, 1.0]],
            [[0.0, 2.0], [0.0, 2.0]],
        ]);
        let values = shapes.assurance();
        let expected = [
            [1.0, 0.0, 0.5, 1.0],
            [0.0, 1.0, 0.5, 0.0],
            [0.5, 0.5, 1.0, 0.5],
            [1.0, 0.0, 0.5, 1.0],
        ];
        for (i, row) in expected.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((values[i][j] - value).abs() < 1e-15, "{i} {j}");
            }
        }
        let svg = matrix_of_squares(&values, "MAC");
        assert_eq!(svg.matches("0.50<").count(), 6);
    }

    #[test]
    fn the_largest_entry_is_drawn_at_its_height_whatever_its_scale() {
        let [one, hundred] =
            [1.0, 100.0].map(|scale| shapes(&[[[scale, 0.0], [0.0, 0.0]]]).draw("a"));
        let drawing = |drawn: &DrawnSet| drawn.svg.replacen("</metadata>", "|", 1);
        assert_eq!(drawing(&one), drawing(&hundred));
        assert!(one.svg.contains("class=\"shape\""));
        assert_eq!(one.map.len(), 1);
    }

    #[test]
    fn poles_are_drawn_with_their_words_over_the_scaled_sum() {
        let pole = |order, frequency_hz, is_stable| StabilisationPole {
            order,
            frequency_hz,
            damping_ratio: 0.02,
            is_stable,
        };
        let poles = [pole(2, 5.0, false), pole(4, 5.01, true)];
        let figure = stabilisation("", &poles, (&[1.0, 5.0, 9.0], &[1e-6, 1e-3, 0.0]));
        let curves = figure.panels()[0].data();
        assert_eq!(curves[0].y(), [0.0, 4.0]);
        let svg = figure.to_interactive_svg("s", "s").unwrap();
        assert!(svg.contains("order 4: 5.01 Hz, damping ratio 2.00 %"), "{svg}");
    }
}

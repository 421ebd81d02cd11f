//! Mode shapes on the points of a structure: deflected lines and the modal assurance criterion.

use mechid_analysis::modal::ShapedMode;
use mechid_analysis::modes::SavedModes;
use mechid_analysis::text::{compact, significant};
use mechid_io::{Geometry, PointShape};
use mechid_plot::{DrawnMode, DrawnSet, ShapeDrawing};
use nalgebra::Complex;

/// Modes with their shapes at the points of a structure.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeShapes {
    /// Points and the lines between them.
    pub geometry: Geometry,
    /// Modes in rising order of frequency; each has a displacement for every point.
    pub modes: Vec<PointShape>,
}

impl ModeShapes {
    /// Combines identified modes, whose entries have these names, such as `1+Z`, with a geometry.
    /// Without a geometry, the names determine a row or a grid of points. Returns `None` if no mode
    /// oscillates, if there are fewer than two entries, or if an entry has no point.
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

    /// Returns the shapes of a result at the points of its responses or, if the geometry names its
    /// points after the columns, at the points of the columns. `None` as for
    /// [`from_modes`](Self::from_modes).
    pub fn from_saved(modes: &SavedModes, geometry: Option<&Geometry>) -> Option<Self> {
        let (shaped, places) = modes.shapes();
        Self::from_modes(&shaped, &places, geometry)
            .or_else(|| Self::from_modes(&shaped, &modes.columns(), geometry))
    }

    /// Draws the first mode on the undeformed lines, and small drawings of all modes, for the
    /// script that animates them.
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
    /// numbers: 1 for the same shape, 0 for orthogonal shapes.
    ///
    /// # Source
    /// R. J. Allemang and D. L. Brown, "A correlation coefficient for modal vector analysis", IMAC
    /// 1 (1982).
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

    /// The criterion must be 0 for the orthogonal shapes (1, 1) and (1, −1), 0.5 for (1, i) with
    /// either of them, and 1 for a shape multiplied by a complex number.
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
}

//! Curves as pixels: mapped, thinned out, and felt for by legends.

use std::collections::HashSet;

use crate::axis::{Mapping, Scale};
use crate::canvas::Point;
use crate::curve::{Curve, Kind};

/// The two mappings of a panel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mappings {
    pub(crate) x: Mapping,
    pub(crate) y: Mapping,
}

/// Pixels of the points `(x, y)`. Values far outside the panel are pulled to where a viewer still computes exactly.
pub(crate) fn map(maps: Mappings, x: &[f64], y: &[f64]) -> Vec<Point> {
    const FAR: f64 = 1e5;
    let pixel = |map: Mapping, value: f64| map.pixel(value).clamp(-FAR, FAR);
    x.iter().zip(y).map(|(&x, &y)| (pixel(maps.x, x), pixel(maps.y, y))).collect()
}

/// Ordinate at which stems stand, px.
pub(crate) fn stem_base(maps: Mappings, scale: Scale, range: (f64, f64)) -> f64 {
    match scale {
        Scale::Linear => maps.y.pixel(0f64.clamp(range.0, range.1)),
        Scale::Log10 => maps.y.pixel(range.0),
    }
}

/// Leaves of each column of pixels the first, the lowest, the highest and the last point of a line.
///
/// The drawn line is the same to within a pixel, and a record of a million samples stays a small file.
/// Lines that run back in x, and lines with few points, are left alone.
pub(crate) fn thin_out(points: Vec<Point>, width: f64) -> Vec<Point> {
    let few = points.len() as f64 <= 4.0 * width;
    if few || points.windows(2).any(|pair| pair[1].0 < pair[0].0) {
        return points;
    }
    let mut kept = Vec::new();
    for column in points.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        let by_height = |a: &&Point, b: &&Point| a.1.total_cmp(&b.1);
        let place = |point: Option<&Point>| {
            point.and_then(|point| column.iter().position(|other| other == point))
        };
        let mut places: Vec<usize> = [
            Some(0),
            place(column.iter().min_by(by_height)),
            place(column.iter().max_by(by_height)),
            Some(column.len() - 1),
        ]
        .into_iter()
        .flatten()
        .collect();
        places.sort_unstable();
        places.dedup();
        kept.extend(places.into_iter().map(|place| column[place]));
    }
    kept
}

/// Leaves one of the points that fall on the same half pixel, the first: the others would not be seen.
pub(crate) fn thin_markers(points: Vec<Point>) -> Vec<Point> {
    let half_pixel = |value: f64| (2.0 * value).floor() as i64;
    let mut taken = HashSet::with_capacity(points.len());
    points.into_iter().filter(|(x, y)| taken.insert((half_pixel(*x), half_pixel(*y)))).collect()
}

/// Leaves of the stems that follow one another on the same half pixel of width the longest.
pub(crate) fn thin_stems(points: &[Point], base: f64) -> Vec<Point> {
    let longer = |a: &&Point, b: &&Point| (a.1 - base).abs().total_cmp(&(b.1 - base).abs());
    points
        .chunk_by(|a, b| (2.0 * a.0).floor() == (2.0 * b.0).floor())
        .filter_map(|column| column.iter().max_by(longer).copied())
        .collect()
}

/// Pixels close together along everything a curve draws.
pub(crate) fn footprint(curve: &Curve, maps: Mappings, base: f64, width: f64) -> Vec<Point> {
    let lower = map(maps, &curve.x, &curve.y);
    match curve.kind {
        Kind::Points => thin_markers(lower),
        Kind::Line | Kind::MarkedLine => {
            dense(thin_out(lower, width).windows(2).map(|pair| (pair[0], pair[1])))
        }
        Kind::Stems => {
            dense(thin_stems(&lower, base).into_iter().map(|(x, y)| ((x, base), (x, y))))
        }
        Kind::Band => {
            let upper = map(maps, &curve.x, &curve.upper);
            dense(lower.windows(2).chain(upper.windows(2)).map(|pair| (pair[0], pair[1])))
        }
    }
}

/// Points on segments, at most four pixels apart.
fn dense(segments: impl Iterator<Item = (Point, Point)>) -> Vec<Point> {
    segments
        .flat_map(|(from, to)| {
            let (dx, dy) = (to.0 - from.0, to.1 - from.1);
            // A segment that leaves the panel by far needs no more points than a screen has.
            let pieces = (dx.hypot(dy) / 4.0).ceil().clamp(1.0, 4000.0) as usize;
            (0..=pieces).map(move |piece| {
                let part = piece as f64 / pieces as f64;
                (from.0 + part * dx, from.1 + part * dy)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_every_extreme_and_both_ends() {
        let points: Vec<Point> = (0..100_000)
            .map(|i| (f64::from(i) * 5e-3, (f64::from(i) * 0.37).sin() * 100.0))
            .collect();
        let kept = thin_out(points.clone(), 500.0);
        assert!(kept.len() <= 4 * 501, "{} points are left", kept.len());
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
        for column in [0.0, 123.0, 499.0] {
            let highest = |points: &[Point]| {
                points
                    .iter()
                    .filter(|p| p.0.floor() == column)
                    .map(|p| p.1)
                    .fold(f64::MIN, f64::max)
            };
            assert_eq!(highest(&kept), highest(&points));
        }
        assert!(kept.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn of_crowded_stems_the_longest_are_left() {
        let points: Vec<Point> =
            (0..1000).map(|i| (f64::from(i) * 0.01, f64::from(i % 7) - 3.0)).collect();
        let kept = thin_stems(&points, 1.0);
        assert_eq!(kept.len(), 20, "ten pixels have twenty halves");
        assert!(kept.iter().all(|(_, y)| *y == -3.0));
        assert_eq!(thin_markers(points).len(), 20 * 7);
    }

    #[test]
    fn lines_that_run_back_are_left_alone() {
        let circle: Vec<Point> = (0..9000).map(|i| f64::from(i).sin_cos()).collect();
        assert_eq!(thin_out(circle.clone(), 100.0), circle);
    }
}

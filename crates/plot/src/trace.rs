//! Curves in pixels: mapped, thinned out, and tested for overlap with legends.

use std::collections::HashSet;

use crate::axis::{Mapping, Scale};
use crate::canvas::Point;
use crate::curve::{Curve, Kind};
use crate::marks::LEAST_RADIUS;

/// Mappings of abscissa and ordinate of a panel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mappings {
    pub(crate) x: Mapping,
    pub(crate) y: Mapping,
}

/// Returns the pixels of the points `(x, y)`. Values far outside the panel are limited to the range
/// that viewers compute exactly.
pub(crate) fn map(maps: Mappings, x: &[f64], y: &[f64]) -> Vec<Point> {
    const FAR: f64 = 1e5;
    let pixel = |map: Mapping, value: f64| map.pixel(value).clamp(-FAR, FAR);
    x.iter().zip(y).map(|(&x, &y)| (pixel(maps.x, x), pixel(maps.y, y))).collect()
}

/// Returns the ordinate at which stems begin, px.
pub(crate) fn stem_base(maps: Mappings, scale: Scale, range: (f64, f64)) -> f64 {
    match scale {
        Scale::Linear => maps.y.pixel(0f64.clamp(range.0, range.1)),
        Scale::Log10 => maps.y.pixel(range.0),
    }
}

/// Keeps the first, the lowest, the highest and the last point of a line in each column of pixels.
///
/// The drawn line is the same to within a pixel, and the file of a record of a million samples
/// stays small. Lines whose x is not monotonic, and lines with few points, are not changed.
pub(crate) fn thin_out(points: Vec<Point>, width: f64) -> Vec<Point> {
    if are_few(&points, width) || points.windows(2).any(|pair| pair[1].0 < pair[0].0) {
        return points;
    }
    let mut thinned = Vec::new();
    for column in points.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        let by_height = |a: &&Point, b: &&Point| a.1.total_cmp(&b.1);
        let index_of = |point: Option<&Point>| {
            point.and_then(|point| column.iter().position(|other| other == point))
        };
        let mut places: Vec<usize> = [
            Some(0),
            index_of(column.iter().min_by(by_height)),
            index_of(column.iter().max_by(by_height)),
            Some(column.len() - 1),
        ]
        .into_iter()
        .flatten()
        .collect();
        places.sort_unstable();
        places.dedup();
        thinned.extend(places.into_iter().map(|at| column[at]));
    }
    thinned
}

/// Returns whether the number of points is at most that of a thinned line in a panel of this width,
/// in px.
fn are_few(points: &[Point], width: f64) -> bool {
    points.len() as f64 <= 4.0 * width
}

/// Keeps the first of the points in the same cell: the others would be hidden. A cell is half a
/// pixel wide and high or, if many points form a cloud, as large as a marker of this radius, in px.
pub(crate) fn thin_markers(points: Vec<Point>, width: f64, radius: f64) -> Vec<Point> {
    let cell = if are_few(&points, width) { 0.5 } else { 2.0 * radius };
    let cell_index = |value: f64| (value / cell).floor() as i64;
    let mut taken = HashSet::with_capacity(points.len());
    points.into_iter().filter(|(x, y)| taken.insert((cell_index(*x), cell_index(*y)))).collect()
}

/// Returns the index of the first point in each square cell; the side of a cell is twice `radius`,
/// in px.
pub(crate) fn thinned_indices(points: &[Point], radius: f64) -> Vec<usize> {
    let cell = |value: f64| (value / (2.0 * radius)).floor() as i64;
    let mut taken = HashSet::new();
    (0..points.len()).filter(|k| taken.insert((cell(points[*k].0), cell(points[*k].1)))).collect()
}

/// Divides a curve into `columns` columns and keeps the highest and the lowest point of each
/// column. If x decreases anywhere, the function keeps one point in each square cell of 2 px
/// instead. Curves of at most `columns` points are not changed.
pub(crate) fn thin_coarsely(points: Vec<Point>, columns: f64) -> Vec<Point> {
    let is_cloud = points.windows(2).any(|pair| pair[1].0 < pair[0].0);
    if points.len() as f64 <= columns {
        return points;
    }
    if is_cloud {
        return thinned_indices(&points, 1.0).into_iter().map(|k| points[k]).collect();
    }
    let (low, high) = (points[0].0, points[points.len() - 1].0);
    let width = (high - low).max(f64::MIN_POSITIVE) / columns;
    let column = |point: &Point| ((point.0 - low) / width).floor();
    let extremes = points.chunk_by(|a, b| column(a) == column(b)).flat_map(|column| {
        let by_height = |a: &&Point, b: &&Point| a.1.total_cmp(&b.1);
        let ends = [column.iter().min_by(by_height), column.iter().max_by(by_height)];
        let mut ends: Vec<Point> = ends.into_iter().flatten().copied().collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends.dedup();
        ends
    });
    extremes.collect()
}

/// Keeps the longest of the consecutive stems whose abscissae are in the same half pixel.
pub(crate) fn thin_stems(points: &[Point], base: f64) -> Vec<Point> {
    let longer = |a: &&Point, b: &&Point| (a.1 - base).abs().total_cmp(&(b.1 - base).abs());
    points
        .chunk_by(|a, b| (2.0 * a.0).floor() == (2.0 * b.0).floor())
        .filter_map(|column| column.iter().max_by(longer).copied())
        .collect()
}

/// Straight segment of a drawing.
pub(crate) type Segment = (Point, Point);

/// Returns all lines of a curve as straight segments; a marker is a segment without length.
pub(crate) fn footprint(curve: &Curve, maps: Mappings, base: f64, width: f64) -> Vec<Segment> {
    let chain = |points: Vec<Point>| -> Vec<Segment> {
        let points = thin_out(points, width);
        // The first point is a separate segment, because a curve of one point has no other segment.
        let first = points.first().map(|&point| (point, point));
        first.into_iter().chain(points.windows(2).map(|pair| (pair[0], pair[1]))).collect()
    };
    let lower = map(maps, &curve.x, &curve.y);
    match curve.kind {
        Kind::Points => thin_markers(lower, width, LEAST_RADIUS)
            .into_iter()
            .map(|point| (point, point))
            .collect(),
        Kind::Line | Kind::MarkedLine => chain(lower),
        Kind::Stems => {
            thin_stems(&lower, base).into_iter().map(|(x, y)| ((x, base), (x, y))).collect()
        }
        Kind::Band => [chain(lower), chain(map(maps, &curve.x, &curve.upper))].concat(),
    }
}

/// Returns whether a segment has a point in the rectangle from `low` to `high`.
///
/// # Source
/// Y.-D. Liang and B. A. Barsky, "A new concept and method for line clipping", ACM Transactions on
/// Graphics 3(1), 1984.
pub(crate) fn meets((from, to): Segment, low: Point, high: Point) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (start, end, low, high) in [(from.0, to.0, low.0, high.0), (from.1, to.1, low.1, high.1)] {
        let run = end - start;
        if run == 0.0 {
            if start < low || start > high {
                return false;
            }
            continue;
        }
        let (first, second) = ((low - start) / run, (high - start) / run);
        enter = enter.max(first.min(second));
        leave = leave.min(first.max(second));
    }
    enter <= leave
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
        assert_eq!(thin_markers(points, 500.0, 1.4).len(), 20 * 7);
    }

    #[test]
    fn a_cloud_of_markers_stays_small_and_covers_the_same() {
        // Markers at every tenth of a pixel fill a square of 50 px, and one more marker is far from
        // them. One marker per cell of 2.5 px must remain, less than 2.5 px from each removed
        // marker.
        let square = (0..250_000).map(|i| (f64::from(i % 500) * 0.1, f64::from(i / 500) * 0.1));
        let points: Vec<Point> = square.chain([(400.0, 100.0)]).collect();
        let kept = thin_markers(points.clone(), 500.0, 1.25);
        assert_eq!(kept.len(), 20 * 20 + 1);
        assert_eq!(kept.last(), points.last());
        for (x, y) in points.iter().step_by(97) {
            let nearest = kept.iter().map(|(a, b)| (a - x).abs().max((b - y).abs()));
            assert!(nearest.fold(f64::MAX, f64::min) < 2.5, "({x}, {y}) is bare");
        }
    }

    #[test]
    fn pieces_meet_a_rectangle_when_a_point_of_theirs_lies_in_it() {
        let (low, high) = ((2.0, 3.0), (6.0, 5.0));
        let ends =
            [(0.0, 0.0), (4.0, 4.0), (9.0, 4.0), (4.0, 9.0), (1.0, 5.5), (7.0, 2.0), (2.0, 3.0)];
        for from in ends {
            for to in ends {
                let inside = (0..=10_000).map(|k| f64::from(k) * 1e-4).any(|part| {
                    let (x, y) = (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
                    (low.0..=high.0).contains(&x) && (low.1..=high.1).contains(&y)
                });
                assert_eq!(meets((from, to), low, high), inside, "{from:?} to {to:?}");
            }
        }
    }

    #[test]
    fn lines_that_run_back_are_left_alone() {
        let circle: Vec<Point> = (0..9000).map(|i| f64::from(i).sin_cos()).collect();
        assert_eq!(thin_out(circle.clone(), 100.0), circle);
    }
}
